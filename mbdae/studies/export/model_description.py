"""modelDescription.xml of FMI 3.0 (https://fmi-standard.org/docs/3.0.1)."""

from collections.abc import Sequence
from html import escape
from typing import NamedTuple
from xml.etree import ElementTree

from .fmi_units import base_exponents

Element = ElementTree.Element
KINDS = {"cs": "CoSimulation", "me": "ModelExchange"}


class Variable(NamedTuple):
    """A variable of an FMU.

    Attributes:
        reference: value reference.
        name: name of the variable.
        causality: ``"independent"``, ``"input"``, ``"parameter"``, ``"output"`` or ``"local"``.
        unit: empty for none.
        start: start value of inputs, parameters and states; None for others.
        derivative: value reference of the state whose derivative the variable is; None for others.
        depends_on_states_only: whether an output depends on states alone, not on inputs.
        is_indicator: whether it is an event indicator.
        description: description in one line.
    """

    reference: int
    name: str
    causality: str
    unit: str = ""
    start: float | None = None
    derivative: int | None = None
    depends_on_states_only: bool = False
    description: str = ""
    is_indicator: bool = False


class FmuDescription(NamedTuple):
    """Data of a modelDescription.xml.

    Attributes:
        name: name of the model.
        identifier: file name of its library.
        token: instantiation token, a digest of its data.
        kinds: ``"cs"``, ``"me"``.
        variables: variables in the order of their value references.
        differentiable: whether all outputs have derivatives.
        step: communication step in s.
        start: start time in s.
        stop: end time in s.
        version: version of mbdae.
    """

    name: str
    identifier: str
    token: str
    kinds: Sequence[str]
    variables: Sequence[Variable]
    differentiable: bool
    step: float | None
    start: float
    stop: float
    version: str

    def xml(self) -> bytes:
        """Return the document."""
        attributes = {"fmiVersion": "3.0", "modelName": self.name, "instantiationToken": self.token}
        root = Element("fmiModelDescription", attributes | {"generationTool": f"mbdae {self.version}"})
        for kind in ("me", "cs"):
            if kind in self.kinds:
                self._interface(root, kind)
        self._units(root)
        log = ElementTree.SubElement(root, "LogCategories")
        for name in ("logStatusError", "logStatusDiscard"):
            ElementTree.SubElement(log, "Category", name=name)
        experiment = {"startTime": _number(self.start), "stopTime": _number(self.stop)}
        experiment |= {"stepSize": _number(self.step)} if self.step else {}
        ElementTree.SubElement(root, "DefaultExperiment", experiment)
        self._variables(ElementTree.SubElement(root, "ModelVariables"))
        self._structure(ElementTree.SubElement(root, "ModelStructure"))
        ElementTree.indent(root)
        document: bytes = ElementTree.tostring(root, "utf-8", xml_declaration=True)
        return document

    def page(self, diagram: str) -> str:
        """Return the documentation page: the picture file ``diagram``, if any, the variables, and the exporter."""
        rows = [
            f"<tr><td>{escape(x.name)}</td><td>{x.causality}</td><td>{escape(x.unit)}</td></tr>"
            for x in self.variables
            if x.causality != "local"
        ]
        table = "\n".join(["<table>", "<tr><th>variable</th><th>causality</th><th>unit</th></tr>", *rows, "</table>"])
        kinds = " and ".join(KINDS[kind] for kind in self.kinds)
        text = f"{kinds}, exported by mbdae {self.version}. All variables are in SI units."
        head = f'<!DOCTYPE html>\n<html lang="en"><meta charset="utf-8"><title>{escape(self.name)}</title>'
        image = f'<p><img src="{diagram}" alt="the mechanism at its start" width="700"></p>\n' if diagram else ""
        return f"{head}\n<h1>{escape(self.name)}</h1>\n<p>{text}</p>\n{image}{table}\n</html>\n"

    def _interface(self, root: Element, kind: str) -> None:
        flags = ["canGetAndSetFMUState", "canSerializeFMUState"]
        if kind == "me":
            flags.append("needsCompletedIntegratorStep")  # to restart local coordinates
            flags += ["providesDirectionalDerivatives", "providesAdjointDerivatives"] if self.differentiable else []
        else:
            flags += [
                "canHandleVariableCommunicationStepSize",
                "providesIntermediateUpdate",
                "canReturnEarlyAfterIntermediateUpdate",
                "hasEventMode",
            ]
        ElementTree.SubElement(root, KINDS[kind], {"modelIdentifier": self.identifier} | dict.fromkeys(flags, "true"))

    def _units(self, root: Element) -> None:
        used = sorted({x.unit for x in self.variables if x.unit})
        if used:
            definitions = ElementTree.SubElement(root, "UnitDefinitions")
        for unit in used:
            element = ElementTree.SubElement(definitions, "Unit", name=unit)
            if (exponents := base_exponents(unit)) is not None:
                ElementTree.SubElement(element, "BaseUnit", {name: str(x) for name, x in exponents.items()})

    def _variables(self, parent: Element) -> None:
        for x in self.variables:
            attributes = {"name": x.name, "valueReference": str(x.reference), "causality": x.causality}
            attributes |= {"description": x.description} if x.description else {}
            attributes |= {"variability": "fixed"} if x.causality == "parameter" else {}
            attributes |= {"unit": x.unit} if x.unit else {}
            exact = "exact" if x.causality in ("parameter", "input") else ""
            attributes |= {"initial": "exact"} if exact and x.causality == "parameter" else {}
            attributes |= {"start": _number(x.start)} if x.start is not None else {}
            attributes |= {"derivative": str(x.derivative)} if x.derivative is not None else {}
            ElementTree.SubElement(parent, "Float64", attributes)

    def _with_causality(self, causality: str) -> list[Variable]:
        return [x for x in self.variables if x.causality == causality]

    def _structure(self, parent: Element) -> None:
        inputs, parameters = ([x.reference for x in self._with_causality(kind)] for kind in ("input", "parameter"))
        outputs, rates = self._with_causality("output"), [x for x in self.variables if x.derivative is not None]
        states, given = [x.derivative for x in rates if x.derivative is not None], [*inputs, *parameters]
        for x in outputs:
            known = states if x.depends_on_states_only else [*inputs, *states]
            ElementTree.SubElement(parent, "Output", _dependencies(x, known))
        for x in rates:
            ElementTree.SubElement(parent, "ContinuousStateDerivative", _dependencies(x, [*inputs, *states]))
        for x in (*outputs, *(y for y in self.variables if y.reference in states), *rates):
            ElementTree.SubElement(parent, "InitialUnknown", _dependencies(x, given))
        for x in self.variables:
            if x.is_indicator:
                ElementTree.SubElement(parent, "EventIndicator", _dependencies(x, [*inputs, *states]))


def event_indicators(first: int, n: int) -> list[Variable]:
    """Return n event indicators with value references from ``first``: guards of contacts, clutches, sticking joints."""
    text = "guard of the current mode, positive while the mode lasts"
    return [Variable(first + i, f"guard[{i + 1}]", "local", description=text, is_indicator=True) for i in range(n)]


def _number(x: float) -> str:
    """Return a number as text; the repr of a numpy scalar is not a number."""
    return repr(float(x))


def _dependencies(x: Variable, known: Sequence[int]) -> dict[str, str]:
    """Return the attributes of an unknown: its value reference and those of its dependencies."""
    return {"valueReference": str(x.reference), "dependencies": " ".join(map(str, sorted(known)))}
