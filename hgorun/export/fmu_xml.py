"""What describes an observer as a unit of FMI: its variables and its sources."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as Xml

from hgorun.export.fmu_templates import ERROR, WARNING, Version
from hgorun.export.fmu_variables import Variable
from hgorun.export.names import shown
from hgorun.export.observer import Exported
from hgorun.version import __version__


def model_identifier(observer: Exported) -> str:
    """What files of the unit are called."""
    return f"hgo_{observer.name}"


def description(
    observer: Exported, variables: Sequence[Variable], version: Version, token: str, sources: Sequence[str]
) -> bytes:
    """The file ``modelDescription.xml``."""
    root = Xml.Element(
        "fmiModelDescription",
        fmiVersion=version,
        modelName=shown(observer.label),
        description=shown(f"observer {observer.label} ({observer.design.observer.type}) of {observer.run}"),
        generationTool=f"hgorun {__version__}",
        variableNamingConvention="structured",
    )
    unit = Xml.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=model_identifier(observer),
        canHandleVariableCommunicationStepSize="true",
    )
    logged = Xml.SubElement(root, "LogCategories")
    for name, meaning in ((WARNING, "a sample is left out, or a step ends in the past"), (ERROR, "a step fails")):
        Xml.SubElement(logged, "Category", name=name, description=meaning)
    Xml.SubElement(root, "DefaultExperiment", startTime="0", stepSize=repr(observer.gap))
    if version == "2.0":
        root.set("guid", token)
        root.set("numberOfEventIndicators", "0")
        unit.attrib |= {"canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true"}
        files = Xml.SubElement(unit, "SourceFiles")
        for source in sources:
            Xml.SubElement(files, "File", name=source)
        _variables_2(root, variables)
    else:
        root.set("instantiationToken", token)
        unit.attrib |= {"canGetAndSetFMUState": "true", "canSerializeFMUState": "true"}
        _variables_3(root, variables)
    return _written(root)


def build_description(observer: Exported, sources: Sequence[str]) -> bytes:
    """The file ``sources/buildDescription.xml`` of FMI 3.0."""
    root = Xml.Element("fmiBuildDescription", fmiVersion="3.0")
    build = Xml.SubElement(root, "BuildConfiguration", modelIdentifier=model_identifier(observer))
    files = Xml.SubElement(build, "SourceFileSet", language="C99")
    for source in sources:
        Xml.SubElement(files, "SourceFile", name=source)
    return _written(root)


def _variables_2(root: Xml.Element, variables: Sequence[Variable]) -> None:
    known = Xml.SubElement(root, "ModelVariables")
    for v in variables:
        common = {"name": v.name, "valueReference": str(v.number), "description": v.meaning}
        if v.kind == "time":
            one = Xml.SubElement(known, "ScalarVariable", common, causality="independent", variability="continuous")
            Xml.SubElement(one, "Real")
        elif v.is_output:
            one = Xml.SubElement(
                known, "ScalarVariable", common, causality="output", variability="continuous", initial="calculated"
            )
            Xml.SubElement(one, "Real")
        else:
            kind = "discrete" if v.is_boolean else "continuous"
            one = Xml.SubElement(known, "ScalarVariable", common, causality="input", variability=kind)
            Xml.SubElement(one, "Boolean" if v.is_boolean else "Real", start="true" if v.is_boolean else "0")
    structure = Xml.SubElement(root, "ModelStructure")
    for part in ("Outputs", "InitialUnknowns"):
        unknowns = Xml.SubElement(structure, part)
        for v in variables:
            if v.is_output:
                Xml.SubElement(unknowns, "Unknown", index=str(v.number + 1))


def _variables_3(root: Xml.Element, variables: Sequence[Variable]) -> None:
    known = Xml.SubElement(root, "ModelVariables")
    for v in variables:
        common = {"name": v.name, "valueReference": str(v.number), "description": v.meaning}
        if v.kind == "time":
            Xml.SubElement(known, "Float64", common, causality="independent", variability="continuous")
        elif v.is_output:
            Xml.SubElement(known, "Float64", common, causality="output", variability="continuous")
        elif v.is_boolean:
            Xml.SubElement(known, "Boolean", common, causality="input", variability="discrete", start="true")
        else:
            Xml.SubElement(known, "Float64", common, causality="input", start="0")
    structure = Xml.SubElement(root, "ModelStructure")
    for part in ("Output", "InitialUnknown"):
        for v in variables:
            if v.is_output:
                Xml.SubElement(structure, part, valueReference=str(v.number))


def _written(root: Xml.Element) -> bytes:
    Xml.indent(root)
    text: str = Xml.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()
