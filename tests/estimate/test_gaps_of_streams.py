"""Times between samples that an observer refuses in a file, it refuses in a stream: where they are stated, or come."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block
from recordings import recording, signal, source

from hgorun.errors import ConfigError
from hgorun.estimate.completed import streamed
from hgorun.estimate.estimate import estimate
from hgorun.estimate.stated_of_data import StatedOfData
from hgorun.estimate.stream.estimator import Estimator

GAP = 0.125
PLANT: Block = {"states": ["p", "v"], "dynamics": {"p": "v", "v": "-0.3*p"}, "output": "p"}
EVEN = (GAP,) * 4
TOO_LONG = "the estimate would not stay bounded; found a/eps = alpha b = 2.5, expected less than 2"
ONLY_COMPARED = "leave alpha and b out, which are only compared with the times of the samples"


def text_of(block: Block, **more: Block) -> Block:
    observers = {"SA": {"type": "hgo_sa", "initial": {"p": 1.0, "v": 0.0}, **block}}
    return {"plant": PLANT, "observers": observers, "solver": {"step": GAP / 8}, **more}


def stream_of(text: Block) -> Estimator:
    given = source(text)
    return Estimator(streamed(given, StatedOfData.of(given), "e"))


def taken_by(estimator: Estimator, t: np.ndarray) -> None:
    for time in t.tolist():
        estimator.update(time, {"p": float(np.cos(time))})


@pytest.mark.parametrize(
    ("block", "gaps", "said", "refused"),
    [
        ({"eps": 0.05}, EVEN, TOO_LONG, 1),
        ({"eps": 0.1}, (GAP, GAP / 2, 2 * GAP), TOO_LONG, 3),
        (
            {"eps": 0.5, "alpha": 0.25, "b": "1/(1+k)"},
            EVEN,
            f"a\\(1\\) = 0.125, .*; {ONLY_COMPARED}",
            2,
        ),
        ({"eps": 0.5, "alpha": 0.5, "b": "1/(1+k)"}, EVEN, "a\\(0\\) = 0.125, but alpha eps b\\(0\\) = 0.25", 1),
        ({"eps": 0.5, "alpha": 0.25, "b": "1/(1+k)"}, (GAP, GAP / 2, GAP / 3), None, 0),
        ({"eps": 0.1}, (GAP, GAP / 2, GAP), None, 0),
    ],
)
def test_a_file_and_a_stream_refuse_them_alike(
    block: Block, gaps: tuple[float, ...], said: str | None, refused: int
) -> None:
    t, text = np.append(0.0, np.cumsum(gaps)), text_of(block)
    log = recording(signal("p", t, np.cos(t)))
    estimator = stream_of(text)
    if said is None:
        taken_by(estimator, t)
        given = {**text, "time": {"start": 0.0, "end": float(t[-1]), "output_step": float(t[-1])}}
        found = estimate(source(given), log, sensitivity=False).observers["SA"]
        np.testing.assert_array_equal(estimator.estimate()["SA"], found.xhat[-1])
        return
    with pytest.raises(ConfigError, match=said):
        estimate(source(text), log, sensitivity=False)
    taken_by(estimator, t[:refused])
    other = stream_of(text)
    other.restore(estimator.checkpoint())
    for one in (estimator, other):
        with pytest.raises(ValueError, match=f"the sample of t = .*: SA: .*{said}"):
            taken_by(one, t[refused : refused + 1])


@pytest.mark.parametrize(
    ("sampling", "said"),
    [
        ({"period": GAP}, TOO_LONG),
        ({"steps": "0.125/(1 + k)"}, TOO_LONG),
        ({"steps": "0.05"}, "the steps do not fall"),
    ],
)
def test_where_they_are_stated_a_stream_is_refused_at_its_start(sampling: Block, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        stream_of(text_of({"eps": 0.05}, measurement={"sampling": sampling}))
