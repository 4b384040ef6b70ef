"""Discriminated unions of tables, tagged by ``kind``; the schema of a kind is built when the kind first occurs.

A process uses only a few of the kinds, and pydantic takes milliseconds to build the schema of each.
"""

from typing import Annotated, Any, get_args

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, SerializationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from .checked_table import Table


class TaggedByKind:
    """Annotation of a union of tables, ``Annotated[Union[PointMass, Rod], TaggedByKind()]``."""

    def __get_pydantic_core_schema__(self, union: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        choices = {c.model_fields["kind"].default: Annotated[c, _LazySchema(c)] for c in get_args(union)}
        return core_schema.tagged_union_schema(
            {kind: handler.generate_schema(choice) for kind, choice in choices.items()}, "kind"
        )


class _LazySchema:
    """Annotation that leaves a table to its own validator, which is built on first use."""

    def __init__(self, table: type[Table]) -> None:
        self.table = table

    def __get_pydantic_core_schema__(self, table: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        dump = core_schema.plain_serializer_function_ser_schema(_dump, info_arg=True)
        return core_schema.no_info_plain_validator_function(self.table.model_validate, serialization=dump)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        self.table.model_rebuild()
        schema_of_table = self.table.__pydantic_core_schema__
        return handler(core_schema.definitions_schema(schema_of_table, []))  # a reference to its definition


def _dump(table: Table, info: SerializationInfo) -> Any:
    options = ("mode", "include", "exclude", "by_alias", "exclude_unset", "exclude_defaults", "exclude_none")
    return table.model_dump(**{name: getattr(info, name) for name in options})
