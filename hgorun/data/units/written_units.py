"""Units as people write them: degrees of temperature, and what is told of a pressure or a volume behind its unit.

To a library of units ``deg C`` is an angle times a charge, ``deg K`` an angle times a temperature, ``bar g`` a bar
times a gram and ``Nm^3`` a cubed newton metre. None of these is what was meant.
"""

from __future__ import annotations

import re

from hgorun.data.units.usual_units import is_usual
from hgorun.patterns import Pattern

_SCALES = {"c": "degC", "f": "degF", "k": "K", "r": "degR"}
_SCALE = r"(C(?:elsius)?|centigrade|F(?:ahrenheit)?|K(?:elvin)?|R(?:ankine)?)"
_SIGN = r"(?:Â?[°º]|[˚∘◦⁰ᵒ])"  # of degrees, also its likenesses, and UTF-8 read as Latin-1
_DEGREES = Pattern(
    rf"(?<!\w)(?:(?:deg(?:ree)?s?\.?|{_SIGN})[\s_-]*|gra?d?\.?\s+){_SCALE}(?![^\W\d_]|\w)", re.IGNORECASE
)
_WORD = Pattern(r"(?<!\w)(Celsius|Centigrade|Fahrenheit|Kelvin)(?!\w)", re.IGNORECASE)
_ANGULAR = Pattern(r"(?<![\w⁻])(?:Â[°º]|[º˚∘◦⁰ᵒ])(?!\w)")
_LETTER_O = Pattern(r"(?<!\w)o([CFK])(?!\w)")
_ONE_SIGN = str.maketrans({"℃": "°C", "℉": "°F", "\N{KELVIN SIGN}": "K"})
_ANGLE = r"(?:[munkµμ]|milli|micro)?(?:deg(?:ree)?s?|°)"
_TEMPERATURE = r"(?:[munµμ]|milli|micro)?(?:(?:delta_)?deg[CFR]|K|kelvins?|C|coulombs?|F|farads?)"
_BOTH = rf"(?:{_ANGLE}(?:SIGN){_TEMPERATURE}|{_TEMPERATURE}(?:SIGN){_ANGLE})"
_SIDE_BY_SIDE = Pattern(rf"(?<!\w){_BOTH.replace('SIGN', '[ ]+')}(?!\w)")
_PRODUCT = Pattern(_BOTH.replace("SIGN", r"\s*[*]\s*"))

_PRESSURE = (
    r"(?:[numµμkMGhcd]?Pa|[numµμkd]?bar|k?psi|ksi|atm|torr|[mc]mHg|inHg|[mc]?mH2O|inH2O|N/mm(?:2|\^2|²)|"
    r"kgf?/cm(?:2|\^2|²)|at)"
)
_TOLD = r"(?:a|g|e|ü|ga|abs|absolute?|gauge|rel|relative?)\.?"
_OF_PRESSURE = Pattern(
    rf"({_PRESSURE})(?:[\s_.-]*{_TOLD}|d|[\s_]*[(\[]\s*(?:{_TOLD}|d|diff\.?)\s*[)\]]|[\s_]*diff\.?)", re.IGNORECASE
)
_CUBED = r"(?:[cdm]?m\s?(?:3|\^3|\*\*3|³)|(?:cu\.?\s?)?ft(?:3|\^3|\*\*3|³)|[mc]?[lL]|liters?|litres?)"
_REST = r"((?![\w^*])(?:\s*/.*|\s+per\s.*|[\s*·]+\w+(?:\^|\*\*)?\(?[-⁻].*)?)"  # per a unit of time
_AT = r"(?:N|n|S|std\.?|STP|NTP|norm(?:al)?\.?|standard|i\.?\s?N\.?)"
_BEFORE = Pattern(rf"(?:[NSs]|(?:std|norm(?:al)?|standard)\.?[\s_]*)({_CUBED}){_REST}")
_BEHIND = Pattern(rf"({_CUBED})(?:[\s_]*\(\s*(?:{_AT}|s)\s*\)|[\s_]*{_AT}){_REST}")
_WITHIN = Pattern(rf"([cd]?m)_?[nN]_?((?:\^|\*\*)?3|³){_REST}")
_AT_THE_END = Pattern(rf"({_CUBED})(\s*/\s*[^\W\d_]+)(?:\s*\(\s*(?:{_AT}|s)\s*\)|\s+{_AT})")
_VOLUMES = (_BEFORE, _BEHIND, _WITHIN, _AT_THE_END)
_FLOWS = {
    **{"cfm": "ft^3/min", "scfm": "ft^3/min", "cfs": "ft^3/s", "scfh": "ft^3/h", "scfd": "ft^3/d", "scf": "ft^3"},
    **{"lpm": "L/min", "slpm": "L/min", "nlpm": "L/min", "slm": "L/min", "sccm": "mL/min", "sccs": "mL/s"},
    **{
        "mscf": "thousand_cubic_feet",
        "mscfd": "thousand_cubic_feet/d",
        "mscfh": "thousand_cubic_feet/h",
        "mmscf": "million_cubic_feet",
    },
    **{"mmscfd": "million_cubic_feet/d", "mmscfh": "million_cubic_feet/h"},
}

_NAMES = {
    "rev": "turn",
    "Torr": "torr",
    **{f"{prefix}Nm": f"({prefix}N*m)" for prefix in ("", "n", "u", "µ", "μ", "m", "c", "d", "da", "k", "M")},
}
_TIMES = str.maketrans({"·": "*", "⋅": "*", "×": "*"})
_RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_ABBREVIATED = Pattern(r"(?:[^\W\d_]\.\s?){2,}")  # a.u., p.u., r.p.m.
_POWER = Pattern(r"([^\W\d_]+)([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+|-?[1-9])(?![\w.])")  # m³, m3, s-1


def with_temperatures(text: str) -> str:
    """A unit in which degrees of temperature are ``degC``, ``degF``, ``degR`` and ``K``, however they were written.

    Those of angles have their sign.
    """

    def scale(match: re.Match[str]) -> str:
        return _SCALES["c" if match[1][0] in "cC" else match[1][0].lower()]

    for pattern in (_DEGREES, _WORD, _LETTER_O):
        text = pattern.sub(scale, text.translate(_ONE_SIGN))
    return _ANGULAR.sub("°", text)


def is_misread(text: str) -> bool:
    """Whether a library of units reads a product in a text that means none; temperatures are written as above."""
    return bool(_SIDE_BY_SIDE.search(text) or _PRODUCT.fullmatch(text)) or without_reference(text) is not None


def temperature_in(text: str) -> str:
    """The temperature in a text in which one is read as a factor beside an angle; empty where none is."""
    found = _SIDE_BY_SIDE.search(text) or _PRODUCT.fullmatch(text)
    of = found and re.search(rf"(?<!\w){_TEMPERATURE}(?!\w)", found[0])
    return {"C": "degC", "F": "degF"}.get(of[0], of[0]) if of else ""


def without_reference(text: str) -> str | None:
    """The unit of a gauge or absolute pressure, or of a volume at normal conditions, by itself; None of any other.

    So it is of flows by their abbreviations. What zero of pressure or what conditions are meant is told by
    ``mbar(a)``, ``kPag``, ``bar abs``, ``Nm3/h``, ``m3(n)/h`` and ``slpm``, and no conversion knows it.
    """
    if text.lower() in _FLOWS:
        return _FLOWS[text.lower()]
    if match := _OF_PRESSURE.fullmatch(text):
        return re.sub(r"^kg(?=/)", "kgf", match[1])
    for pattern in _VOLUMES:
        if match := pattern.fullmatch(text):
            return "".join(part or "" for part in match.groups()).strip()
    return None


def reference_of(text: str) -> str:
    """What is told of a pressure or a volume behind its unit, in one notation; empty where nothing is.

    ``barg``, ``bar(g)`` and ``bar rel`` are one, as ``Nm3/h`` and ``m3/h i.N.`` are.
    """
    plain = without_reference(text)
    if plain is None:
        return ""
    if text.lower() in _FLOWS:
        return text[0].upper() if text[0] in "sSnN" else "S" if "scf" in text.lower() else ""
    if match := _OF_PRESSURE.fullmatch(text):
        letter = re.sub(r"[\W_]", "", text[match.end(1) :])[:1].lower()
        return {"a": "absolute", "d": "difference"}.get(letter, "gauge")
    match = next(match for pattern in _VOLUMES if (match := pattern.fullmatch(text)))
    ends = [match.start(), *(place for k in range(1, match.re.groups + 1) for place in match.span(k)), match.end()]
    told = "".join(text[first:end] for first, end in zip(ends[::2], ends[1::2], strict=True))
    letters = re.sub(r"[\W_]", "", told).upper()
    return "NTP" if letters == "NTP" else "N" if letters[:1] in ("N", "I") else "S"


def in_usual_notation(text: str) -> str:
    """A unit as pint reads it: ``m3``, ``L-1``, ``·`` and ``s⁻¹`` are usual, too."""

    def raised(match: re.Match[str]) -> str:
        name, power = match.groups()
        return f"{name}^{power.translate(_RAISED)}" if is_usual(name) else match[0]

    if without_reference(text) is not None:
        return text  # Nm^3 is no power of N m
    text = with_temperatures(text)
    for name, meant in _NAMES.items():
        text = re.sub(rf"(?<!\w){re.escape(name)}(?!\w)", meant, text)
    return _POWER.sub(raised, text.translate(_TIMES))


def without_points(unit: str) -> str:
    """A unit without the points of an abbreviation: a.u. and au, p.u. and pu are one notation."""
    return unit.replace(".", "").replace(" ", "") if _ABBREVIATED.fullmatch(unit) else unit
