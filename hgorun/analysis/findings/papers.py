"""What the papers of Lee, Meiners and Katayama assume and conclude, for the observers that are theirs."""

from __future__ import annotations

from dataclasses import asdict

from hgorun.analysis.finding import finding
from hgorun.analysis.papers.katayama import katayama_conditions
from hgorun.analysis.papers.lee import lee_conditions
from hgorun.analysis.papers.meiners import meiners_conditions
from hgorun.analysis.subject import Subject
from hgorun.observers.forward_differences import ForwardDifferences
from hgorun.observers.output_injection import OutputInjection
from hgorun.observers.reduced_order import ReducedOrder


@finding(
    "what Lee, Choi, Khalil 2016 assume and conclude: conditions, constants, a certificate, bounds",
    applies=lambda o: isinstance(o.observer, ForwardDifferences),
)
def lee(observer: Subject) -> dict[str, object]:
    return asdict(lee_conditions(observer.run, observer.label, observer.result))


@finding(
    "what Meiners, Adamy 2025 assume and conclude: conditions, constants, certificates, bounds",
    applies=lambda o: isinstance(o.observer, OutputInjection),
)
def meiners(observer: Subject) -> dict[str, object]:
    return asdict(meiners_conditions(observer.run, observer.label, observer.result))


@finding(
    "what Katayama assumes and concludes: conditions, constants, bounds",
    applies=lambda o: isinstance(o.observer, ReducedOrder),
)
def katayama(observer: Subject) -> dict[str, object]:
    return asdict(katayama_conditions(observer.run, observer.label, observer.result))
