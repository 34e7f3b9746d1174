"""Units of plants as people abbreviate them, and what each may mean: it is asked, since nothing converts by a guess.

``kg/cm2`` of a pressure is a force on an area, ``GPM`` are gallons a minute, ``mWC`` is a column of water. A library of
units has none of them, or reads another kind of quantity.
"""

from __future__ import annotations

import re

_AS_WRITTEN = {
    **dict.fromkeys(("mil", "mils"), "thou"),
    **{"mD": "millidarcy", "lbm": "lb", "sqft": "ft^2", "kp": "kgf", "PS": "metric_horsepower", "g": "g_0"},
    **dict.fromkeys(("ft-lb", "lb-ft", "ft.lb", "ft·lb"), "ft_lb"),
    **dict.fromkeys(("in-lb", "lb-in", "in.lb", "in·lb"), "in*lbf"),
    **{"mPas": "mPa s", "Pas": "Pa s", "cps": "cP", "at": "kgf/cm2"},
    **{"kpm": "kgf*m", "kpcm": "kgf*cm", "PSh": "metric_horsepower h", "o/oo": "permille", "0/00": "permille"},
    **{"mho": "S", "mho/cm": "S/cm", "mmho/cm": "mS/cm", "umho/cm": "uS/cm", "µmho/cm": "uS/cm"},
}
_TEMPERATURES = (
    *("K", "kelvin", "degC", "degree_Celsius", "degF", "degree_Fahrenheit", "degR", "degree_Rankine"),
    *("°C", "°F"),
)
_IN_ANY_LETTERS = {
    **dict.fromkeys(("kg/cm2", "kp/cm2"), "kgf/cm2"),
    **{"kg/mm2": "kgf/mm2", "kg/m2": "kgf/m2", "psf": "lbf/ft^2"},
    **dict.fromkeys(("mwc", "mws", "mce", "mwg", "mh2o"), "mH2O"),
    **dict.fromkeys(("mmwc", "mmws", "mmce", "mmwg", "mmh2o"), "mmH2O"),
    **dict.fromkeys(("cmwc", "cmws", "cmce", "cmwg", "cmh2o"), "cmH2O"),
    **dict.fromkeys(("inwc", "inwg", "inh2o", "iwc", '"wc', '"wg', '"h2o'), "inH2O"),
    **dict.fromkeys(("ftwc", "ftwg", "fth2o"), "ftH2O"),
    **{"mmhg": "mmHg", "cmhg": "cmHg", "inhg": "inHg", '"hg': "inHg"},
    **dict.fromkeys(("gpm", "usgpm"), "gal/min"),
    **{"gph": "gal/h", "gpd": "gal/d", "cmh": "m^3/h", "cbm": "m^3", "cbm/h": "m^3/h"},
    **{"lph": "L/h", "lps": "L/s", "ccm": "cm^3", "ccm/min": "cm^3/min", "ccm/h": "cm^3/h", "acfm": "ft^3/min"},
    **{"cuft": "ft^3", "cuft/min": "ft^3/min", "cuft/h": "ft^3/h", "cfh": "ft^3/h", "fpm": "ft/min", "ips": "in/s"},
    **{"tph": "t/h", "tpd": "t/d", "pph": "lb/h", "bbl": "oil_barrel", "bbl/h": "oil_barrel/h", "bph": "oil_barrel/h"},
    **dict.fromkeys(("bbl/d", "bbl/day", "bpd", "bopd", "bwpd"), "oil_barrel/d"),
    **dict.fromkeys(("mmbtu/h", "mmbtu/hr", "mmbtuh"), "million_Btu/h"),
    **{"mmbtu": "million_Btu", "mbh": "thousand_Btu/h", "btuh": "BTU/h"},
    **{"pct": "percent", "perc": "percent", **dict.fromkeys(("permil", "promil", "promille", "permille"), "permille")},
    **dict.fromkeys(("u/min", "r/min", "upm", "tr/min"), "rpm"),
}
_FACTORS = {"kp": "kgf", "lbm": "lb", "PS": "metric_horsepower", "mho": "S", "bbl": "oil_barrel", "cbm": "m^3"}
_GERMAN = {
    **{"gramm": "g", "kilogramm": "kg", "milligramm": "mg", "prozent": "percent"},
    **dict.fromkeys(("sekunde", "sekunden"), "s"),
    **dict.fromkeys(("minute", "minuten"), "min"),
    **dict.fromkeys(("stunde", "stunden"), "h"),
    **dict.fromkeys(("umdrehung", "umdrehungen"), "turn"),
}
_BETWEEN = re.compile(r"([\s*·/()]+)")
_PLAIN = str.maketrans({"²": "2", "³": "3", "^": "", ".": "", " ": "", "_": ""})
_OF_PERCENT = r"(?:r\.?\s?[hf]\.?|rel\.?|vol\.?|v/v|wt\.?|w/w|m/m|ma(?:ss)?\.?|mole?|gew\.?|sat\.?|open)"
_PERCENT = re.compile(rf"%\s*(?:{_OF_PERCENT}|\({_OF_PERCENT}\))|{_OF_PERCENT}[\s-]*%", re.IGNORECASE)
_PER_KELVIN = re.compile(r"([^()/]+)/\(?((?:[cm]?m|ft)(?:\^?2|²)|[cm]?m|k?g|k?mol)\s?K\)?")  # W/m2K
_OF_POWER = re.compile(r"([kMG]?W)(?:el?|th|p)")  # electrical, thermal, at its peak
_GLUED = re.compile(r"([kM]?N)([cm]m)|(k?g)([cm]?m)[2²]")  # torques, moments of inertia
_PRODUCT = re.compile(r"[^\W\d_]{1,4}-?\d?(?:\.[^\W\d_]{1,4}-?\d?)+(?:/[^\W_]{1,4})?")  # mPa.s, J.kg-1.K-1


def meant_by(text: str) -> str | None:
    """The unit that an abbreviation may mean, as it is converted; None where none is known.

    A text may be a unit of something else: a mass on an area beside a pressure, a gram beside an acceleration.
    """
    known = _AS_WRITTEN.get(text) or _IN_ANY_LETTERS.get(text.translate(_PLAIN).casefold())
    if known is not None:
        return known
    if _PERCENT.fullmatch(text):
        return "percent"
    if match := _PER_KELVIN.fullmatch(text):
        return f"{match[1]}/({match[2]} K)"
    if match := _OF_POWER.fullmatch(text):
        return match[1]
    if match := _GLUED.fullmatch(text):
        return f"{match[1]}*{match[2]}" if match[1] else f"{match[3]}*{match[4]}^2"
    factors = _BETWEEN.split(text)
    if len(factors) > 1 and _FACTORS.keys() & {*factors}:
        return "".join(_FACTORS.get(one, one) for one in factors)  # kp m
    german = "".join(_GERMAN.get(one.lower(), one) for one in factors)
    if german != text:
        return german
    return text.replace(".", " ") if _PRODUCT.fullmatch(text) else None


def german_degrees(text: str, wanted: str) -> str:
    """Which degrees the German word for them means beside a unit; empty of any other word.

    To others it is a part of a right angle in a hundred, and to a library of units a billion rad.
    """
    if text not in ("Grad", "grad"):
        return ""
    return "degC" if wanted in _TEMPERATURES else "deg"
