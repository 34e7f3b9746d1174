"""What somebody may have meant: the most similar name, or what a key is called elsewhere."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable
from itertools import islice
from pathlib import Path

from hgorun.errors import ConfigError
from hgorun.files import why_unreachable

# What others call the keys of a configuration.
_CALLED_ELSEWHERE = {
    **dict.fromkeys(("dt", "delta_t", "sample_time"), ("output_step", "step", "period")),
    **dict.fromkeys(("ts", "t_s", "sampling_time"), ("period", "output_step")),
    **dict.fromkeys(("tf", "t_f", "tspan", "duration", "horizon"), ("end",)),
    **dict.fromkeys(("x0", "ic", "init", "x_0", "start_values"), ("initial",)),
    **dict.fromkeys(("sigma", "stddev", "standard_deviation"), ("std",)),
    "step": ("output_step",),
    "rms": ("rmse", "std"),
    **dict.fromkeys(("min", "lower"), ("low",)),
    **dict.fromkeys(("max", "upper"), ("high",)),
    **dict.fromkeys(("gain", "l", "high_gain", "ell"), ("theta", "gains", "shgo")),
    **dict.fromkeys(("hgo", "highgain", "high_gain_observer"), ("shgo",)),
    **dict.fromkeys(("vdp", "vanderpol"), ("van_der_pol",)),
    **dict.fromkeys(("kf", "kalman", "kalman_filter"), ("kalman_bucy",)),
    **dict.fromkeys(("extended_kalman_filter", "extended_kalman"), ("ekf",)),
    **dict.fromkeys(("unscented_kalman_filter", "unscented_kalman", "unscented", "sigma_point"), ("ukf",)),
    **dict.fromkeys(("moving_horizon", "moving_horizon_estimator", "moving_horizon_estimation"), ("mhe",)),
    **dict.fromkeys(("extended_state_observer", "adrc", "ladrc"), ("eso",)),
    **dict.fromkeys(("savitzky_golay", "sgolay"), ("savgol",)),
    **dict.fromkeys(("robust_exact_differentiator", "super_twisting_differentiator"), ("red", "levant")),
    **dict.fromkeys(("kazantzis_kravaris", "kazantzis_kravaris_luenberger"), ("kkl",)),
    **dict.fromkeys(("smo", "sliding_mode", "sta"), ("super_twisting",)),
    **dict.fromkeys(("rk45", "ode45", "dopri", "dop853"), ("dopri5",)),
    **dict.fromkeys(("ode15s", "ode23s", "bdf", "radau", "lsoda"), ("rodas5p",)),
    **dict.fromkeys(("rk", "runge_kutta", "ode4"), ("rk4",)),
    **dict.fromkeys(("ode", "f", "equations", "rhs", "eqs", "model"), ("dynamics", "plant")),
    **dict.fromkeys(("y", "h", "measured", "sensor"), ("output", "measurement")),
    **dict.fromkeys(("u", "control"), ("inputs", "controller")),
    **dict.fromkeys(("time", "tau"), ("t",)),
    **dict.fromkeys(("p", "constants", "consts"), ("parameters",)),
    **dict.fromkeys(("eigenvalues", "k"), ("poles", "gains")),
    **dict.fromkeys(("lag", "latency", "dead_time"), ("delay",)),
    **dict.fromkeys(("integrator", "simulation"), ("solver", "method", "time")),
    **dict.fromkeys(("estimators", "filters", "filter"), ("observers",)),
    **dict.fromkeys(("tex", "latex2e", "booktabs"), ("latex",)),
    **dict.fromkeys(("txt", "plain", "table"), ("text",)),
}
# What is not the same, but follows from it.
_FOLLOWS = {
    **dict.fromkeys(("variance", "var", "sigma2"), ("std", "its square root")),
    **dict.fromkeys(("rate", "frequency", "freq", "fs", "f_s", "hz"), ("period", "its inverse")),
    **dict.fromkeys(("epsilon", "eps", "varepsilon"), ("theta", "its inverse")),
}


# Letters of other alphabets that look like those of names.
_LOOK_ALIKE = str.maketrans(
    "асеԁһіјкорѕтухАВСЕНІЈКМОРЅТХУαικνορτυχΑΒΕΗΙΚΜΝΟΡΤΥΧΖ",
    "acedhijkopstyxABCEHIJKMOPSTXYaiknoptuxABEHIKMNOPTYXZ",
)


def nearest(name: str, candidates: Iterable[str]) -> str:
    """Return " Did you mean `x`?" with the candidate most like ``name``, or called so elsewhere, or "" if none is.

    Of a letter of another alphabet that looks like ours, of which nobody sees it, it is said.
    """
    known = tuple(candidates)
    found, how = _meant(name, known)
    latin = name.translate(_LOOK_ALIKE)
    mixed = latin != name and (latin in known or re.search("[A-Za-z]", name))
    if mixed and (meant_by := _meant(latin, known)[0]):
        other = next(letter for letter, own in zip(name, latin, strict=True) if letter != own)
        return f" Did you mean `{meant_by}`, without the letter {other!r} of another alphabet ({_alphabet(other)})?"
    return f" Did you mean `{found}`{how and f', {how}'}?" if found else ""


def _alphabet(letter: str) -> str:
    import unicodedata

    return unicodedata.name(letter).partition(" ")[0].capitalize()


def meant(name: str, candidates: Iterable[str]) -> str:
    """The same behind a message that ends with what is known: ". Did you mean `x`?"."""
    found = nearest(name, candidates)
    return found and f".{found}"


LISTED = 12
"""Names in a message, of which there may be more."""
COMPARED = 10_000
"""Names whose likeness is looked at."""


def listed(names: Iterable[object], wanted: str = "", see: str = "") -> str:
    """Names as a message lists them: a dozen, and how many more there are.

    Parameters
    ----------
    names : iterable
    wanted : str
        Where there are more, those most like it come first.
    see : str
        The command that lists all.
    """
    known = list(map(str, names))
    if len(known) <= LISTED:
        return ", ".join(known) or "none"
    shown = islice(_by_likeness(wanted, known[:COMPARED]) if wanted else known, LISTED)
    return f"{', '.join(shown)} and {len(known) - LISTED} more{see and f', see `{see}`'}"


def _by_likeness(name: str, known: Iterable[str]) -> list[str]:
    """Names, the most similar first; those that are equally so stay in their order."""
    from difflib import SequenceMatcher

    same = SequenceMatcher(b=name[:100].lower())

    def unlike(other: str) -> float:
        same.set_seq1(other[:100].lower())
        return -same.ratio()

    return sorted(known, key=unlike)


def among(name: str, candidates: Iterable[str]) -> str:
    """What is known, and what may be meant of it: how a message ends where a name is none of these."""
    known = tuple(candidates)
    return f"{listed(known, name)}{meant(name, known)}"


def refuse_other(option: str, value: str, known: Iterable[str]) -> None:
    """Refuse a word that an option does not know.

    Raises
    ------
    ConfigError
    """
    words = tuple(known)
    if value not in words:
        raise ConfigError(f"{option}: expected one of {', '.join(words)}, found {value!r}{meant(value, words)}")


def nearest_name(name: str, candidates: Iterable[str]) -> str:
    """The candidate that :func:`nearest` names, or ""."""
    return _meant(name, candidates)[0]


def _meant(name: str, candidates: Iterable[str]) -> tuple[str, str]:
    """The candidate that is meant, and how it follows where it is not the same; both empty where there is none."""
    known = {candidate.lower(): candidate for candidate in islice(candidates, 1_000) if len(candidate) < 100}
    other, how = _FOLLOWS.get(name.lower(), ("", ""))
    if other in known:
        return known[other], how
    elsewhere = (other for other in _CALLED_ELSEWHERE.get(_UNWORDED.sub("_", name.lower()), ()) if other in known)
    found = next(elsewhere, None) or _closest(name, (low for low, own in known.items() if not _too_short(name, own)))
    return ("", "") if found is None else (known[found], "")


_UNWORDED = re.compile(r"[ -]+")


def _too_short(name: str, other: str) -> bool:
    """Whether so little is written that letters alike say nothing: ``d`` is not meant by ``OD``, ``x`` by ``x1`` is."""
    short, long = sorted((name, other), key=len)
    if len(short) == len(long) or len(short) > 2:
        return False
    if len(short) == 1 and long[1:].isalpha() and set(long) != {short}:
        return True
    return not set(short) <= set(long)


def nearest_file(name: str, names: Iterable[str]) -> str:
    """The same of files: their suffixes make no two of them alike; of equal ones a YAML file is meant."""
    stems: dict[str, str] = {}
    for other in sorted(islice(names, 1_000), key=lambda one: not one.endswith((".yaml", ".yml"))):
        stems.setdefault(os.path.splitext(other)[0].lower(), other)
    close = _closest(os.path.splitext(name)[0], stems)
    return "" if close is None else f" Did you mean `{stems[close]}`?"


MEASURED = frozenset((".csv", ".txt", ".dat", ".tsv", ".log", ".parquet", ".h5", ".hdf5", ".nc", ".mat", ""))
"""How names of files of measurements end, as a rule."""


def near_file(path: Path, suffixes: Collection[str] | None = None) -> str:
    """Of a file that is not there: ". Did you mean `x`?" with the most similar name in its folder, or "".

    Parameters
    ----------
    path : Path
    suffixes : collection of str, optional
        How the names end that may be meant, any by default; names that end as that of the file may always be.
    """
    try:
        names = [entry.name for entry in path.parent.iterdir() if entry.name != path.name]  # as of a link to nothing
    except OSError:
        return ""
    if suffixes is not None:
        names = [name for name in names if os.path.splitext(name)[1].lower() in {path.suffix.lower(), *suffixes}]
    alike = [name for name in names if os.path.splitext(name)[1] == path.suffix]
    near = nearest_file(path.name, alike) or nearest_file(path.name, names)
    if not near and os.sep == "/" and "\\" in path.name:
        near = " Folders are separated by / here"
    return near and f".{near}"


def no_file(path: Path, suffixes: Collection[str] | None = None) -> str:
    """What is said of a path that is not that of a file, and why where the system tells; for its parameters see above.

    Of a folder, where one is not meant, whoever asks says more.
    """
    if os.path.isdir(path):
        return "this is a folder"
    if os.path.exists(path):
        return "not a regular file"
    why = why_unreachable(path)
    return f"cannot be read: {why}" if why else f"there is no such file{near_file(path, suffixes)}"


def _closest(name: str, known: Iterable[str]) -> str | None:
    """The most similar of some names in small letters."""
    import difflib

    alike = [other for other in known if len(other) > 1 or len(name) < 3]  # a word is not meant to be a letter
    if len(name) < 4:  # some letters of a long word are no part of it that is written
        alike = [other for other in alike if len(other) <= 2 * len(name) or other.startswith(name.lower())]
    close = difflib.get_close_matches(name[:100].lower(), alike, n=1, cutoff=0.5 if len(name) < 4 else 0.6)
    return close[0] if close else None
