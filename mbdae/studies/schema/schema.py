"""JSON Schema of mechanism files and of sweep files, from the classes that validate them."""

from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import PydanticOmit, core_schema

from ...errors import UnknownNameError
from ...integrate.steppers.solvers import SOLVERS
from ...mechanism.formats.mechanism_file.schema import MechanismFile
from ...methods import EXPLICIT, METHODS
from ..sweep.toml_file import SweepTable

__all__ = ["schema"]

FILES = {"mechanism": MechanismFile, "sweep": SweepTable}
INPUT = {  # a reference, { input = NAME }
    "type": "object",
    "properties": {"input": {"type": "string"}},
    "required": ["input"],
    "additionalProperties": False,
}
DIALECT = "https://json-schema.org/draft/2020-12/schema"


class FileSchema(GenerateJsonSchema):
    """JSON Schema of a file, with the short forms that validators convert, and without Python functions."""

    def callable_schema(self, schema: core_schema.CallableSchema) -> JsonSchemaValue:
        """Omit Python functions."""
        raise PydanticOmit

    def function_before_schema(self, schema: core_schema.BeforeValidatorFunctionSchema) -> JsonSchemaValue:
        """Add the types that a validator accepts and converts."""
        inner, name = super().function_before_schema(schema), getattr(schema["function"]["function"], "__name__", "")
        if name == "_coerce":  # validator of functions of time
            return {"anyOf": [{"type": "number"}, INPUT, inner]}
        if name == "_as_sources":  # validator of lists of sources
            return {"anyOf": [{"type": "string"}, inner["items"], inner]}
        return inner

    def tagged_union_schema(self, schema: core_schema.TaggedUnionSchema) -> JsonSchemaValue:
        """List the kinds, so that an error for an unknown kind lists them."""
        out = super().tagged_union_schema(schema)
        kind = out["discriminator"]
        return {**out, "properties": {kind["propertyName"]: {"enum": list(kind["mapping"])}}}


def schema(file: str = "mechanism") -> dict[str, Any]:
    """Return the JSON Schema of a kind of file.

    Args:
        file: ``"mechanism"`` or ``"sweep"``.

    Raises:
        UnknownNameError: for an unknown kind.
    """
    if file not in list(FILES):
        raise UnknownNameError("kind of file", file, FILES)
    out = FILES[file].model_json_schema(schema_generator=FileSchema)
    tables = out.get("$defs", {})
    if "SolveSettings" in tables:
        tables["SolveSettings"]["properties"]["method"] = {"enum": [*METHODS, *EXPLICIT, *SOLVERS]}
    return {"$schema": DIALECT, **out, "title": f"mbdae {file} file"}
