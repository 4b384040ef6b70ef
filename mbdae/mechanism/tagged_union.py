"""Discriminated unions of tables, tagged by ``kind``; the schema of a kind is built when the kind first occurs.

A process uses only a few of the kinds, and pydantic takes milliseconds to build the schema of each.
"""

from collections.abc import Mapping
from typing import Annotated, Any, get_args

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, SerializationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from .checked_table import Table


class TaggedByKind:
    """Annotation of a union of tables, ``Annotated[Union[PointMass, Rod], TaggedByKind()]``.

    Args:
        tables: the tables by kind, if they are imported on first use: ``Annotated[Any, TaggedByKind(tables)]``.
    """

    def __init__(self, tables: Mapping[str, type[Table]] | None = None) -> None:
        self.tables = tables

    def __get_pydantic_core_schema__(self, union: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        tables = self.tables or {c.model_fields["kind"].default: c for c in get_args(union)}
        choices = {kind: handler.generate_schema(Annotated[Any, _LazySchema(tables, kind)]) for kind in tables}
        return core_schema.tagged_union_schema(choices, "kind")


class _LazySchema:
    """Annotation that delegates to the validator of a table, which is built on first use."""

    def __init__(self, tables: Mapping[str, type[Table]], kind: str) -> None:
        self.tables, self.kind = tables, kind

    def __get_pydantic_core_schema__(self, table: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        dump = core_schema.plain_serializer_function_ser_schema(_dump, info_arg=True)
        return core_schema.no_info_plain_validator_function(self._validate, serialization=dump)

    def _validate(self, value: Any) -> Table:
        return self.tables[self.kind].model_validate(value)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        table = self.tables[self.kind]
        table.model_rebuild()
        schema_of_table = table.__pydantic_core_schema__
        return handler(core_schema.definitions_schema(schema_of_table, []))  # a reference to its definition


def _dump(table: Table, info: SerializationInfo) -> Any:
    options = ("mode", "include", "exclude", "by_alias", "exclude_unset", "exclude_defaults", "exclude_none")
    return table.model_dump(**{name: getattr(info, name) for name in options})
