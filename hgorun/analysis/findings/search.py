"""What only simulating again and again finds."""

from __future__ import annotations

from hgorun.analysis.convergence.premises import theta_of
from hgorun.analysis.finding import finding
from hgorun.analysis.reasons import NoValue
from hgorun.analysis.search import critical_theta
from hgorun.analysis.subject import Subject


@finding(
    "with `--search`: to 2 % the largest theta that fails below the working range, the range of theta around or next "
    "above the configured one where the error of a run without noise and disturbance decays to 1 %. It is found by "
    "halving or doubling: a gap of less than a factor of 2 can be missed, and smaller theta may work again",
    group="theta",
    unit="1/time",
)
def theta_critical(observer: Subject) -> float:
    if not observer.context.search:
        raise NoValue("found only by repeated simulation: use --search")
    return critical_theta(observer.run.experiment, observer.label, theta_of(observer))
