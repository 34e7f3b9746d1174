"""A key in another block than its own is told where it is written."""

from __future__ import annotations

from pathlib import Path

import pytest

from hgorun import load
from hgorun.config import belonging
from hgorun.config.belonging import belongs
from hgorun.config.data import Data, Measured
from hgorun.config.models import File
from hgorun.config.study import Ensemble, Figure
from hgorun.config.tuning import Tune
from hgorun.config.types import Block, _blocks
from hgorun.errors import ConfigError, KeyPath
from hgorun.measurement.blocks import Measurement, Periodic, Steps, Times
from hgorun.noise.gaussian import GaussianNoise
from hgorun.observers.shgo import StandardObserver
from hgorun.plants.inline import InlinePlant

BLOCKS: dict[str, tuple[type[Block], ...]] = {
    "": (File,),
    "plant": (InlinePlant,),
    "measurement": (Measurement,),
    "measurement.sampling": (Periodic, Times, Steps),
    "measurement.noise": (GaussianNoise,),
    "observers.NAME": (StandardObserver,),
    "data": (Data,),
    "data.outputs.NAME": (Measured,),
    "tune": (Tune,),
    "runs.NAME": (Ensemble,),
    "figures.NAME": (Figure,),
}


def test_every_place_has_the_key() -> None:
    """And of blocks whose keys are told elsewhere, all are."""
    places = [(key, one) for key, one in belonging._WRITTEN.items()]
    places += [(key, one) for key, several in belonging._ALSO.items() for one in several]
    for key, one in places:
        block = one.partition(":")[0].rpartition(".")[0] if ":" not in one else one.partition(":")[0]
        classes = BLOCKS.get(block) or tuple(_blocks(File.model_fields[block].annotation))
        assert any(key in cls.model_fields for cls in classes), one
    assert {"sampling", "delay", "noise", "mode", "phases"} == Measurement.model_fields.keys() - {"outputs"}


@pytest.mark.parametrize(
    ("place", "key", "meant"),
    [
        (("measurement", "sampling"), "delay", "`measurement.delay`"),
        (("measurement", "sampling"), "noise", "`measurement.noise`"),
        (("measurement", "outputs", "y", "sampling"), "delay", "`measurement.outputs.y.delay`"),
        (("measurement", "phases", 0, "noise", 1), "jitter", "`measurement.phases.0.sampling.jitter`"),
        (("observers", "S"), "delay", "`measurement.delay`"),
        (("observers", "S", "hold"), "theta", "`observers.S.theta`"),
        (("time",), "rtol", "`solver.rtol`"),
        (("solver",), "seed", "`seed` at the top of the file"),
        ((), "initial", "`plant.initial` or `observers.NAME.initial`"),
        (("plant",), "std", "`measurement.noise: [{type: gaussian, std: ...}]`"),
        (("data", "outputs", "y", "time"), "gate", "`data.outputs.y.gate`"),
        (("measurement", "phases", 0, "outputs", "y", "noise"), "mode", "`measurement.phases.0.outputs.y.mode`"),
        (("plant",), "inital", ""),
        (("measurement",), "delay", ""),
    ],
)  # fmt: skip
def test_where_a_key_belongs(place: KeyPath, key: str, meant: str) -> None:
    assert belongs(place, key) == (meant and f" Did you mean {meant}?")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("measurement: {sampling: {period: 1, delay: 2}}", "key 'delay'. Did you mean `measurement.delay`? Known"),
        ("measurement: {sampling: {noise: []}}", "found noise. `noise` stands beside `sampling`, not in it"),
        ("time: {end: 1, output_step: 0.1, step: 1}", "Did you mean `output_step`? Or `solver.step`? Known here"),
        ("outputs: {y: {delay: 1}}", "Did you mean `measurement.outputs` or `data.outputs`? Known here"),
        ("measurement: {period: 1}", "unknown key 'period'. It is a key of `sampling`. Known here"),
        ("measurement: {gate: 5}", "key 'gate'. `gate` is for recorded data, as `data.outputs.NAME.gate`: see `hgor"),
        ("time: {end: 1, gate: 5}", "key 'gate'. `gate` is for recorded data, as `data.outputs.NAME.gate`: see `hgor"),
        ("data: {time: t, outputs: {x1: x}, unit: m}", "It is a key of `time`, `outputs`, `inputs` and `reference`."),
        ("data: {time: t, outputs: {x1: x}, gate: 5}", "unknown key 'gate'. It is a key of `outputs`. Known here"),
        ("solver: {stepp: 1, seed: 2}", "unknown key 'seed'. Did you mean `seed` at the top of the file?"),
    ],
)  # fmt: skip
def test_it_is_told(tmp_path: Path, wrong: str, message: str) -> None:
    lines = [
        "time: {end: 1, output_step: 0.1}",
        "plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}",
        "observers: {S: {type: shgo, theta: 2}}",
    ]
    block = wrong.partition(":")[0]
    file = tmp_path / "c.yaml"
    file.write_text("\n".join([*(line for line in lines if not line.startswith(block)), wrong]))
    with pytest.raises(ConfigError) as caught:
        load(file)
    assert any(message in str(one) for one in (caught.value, *caught.value.others)), caught.value


def test_of_a_path_to_no_list_the_deepest_block_is_told() -> None:
    base = load({
        "time": {"end": 1, "output_step": 0.1},
        "plant": {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0}},
        "measurement": {"sampling": {"period": 0.1}, "noise": [{"type": "gaussian", "std": 0.1}]},
        "observers": {},
    })  # fmt: skip
    for path, message in (
        ("measurement.nois.0.std", "; `measurement` has sampling, noise. Did you mean `measurement.noise`?"),
        (
            "measurement.outputs.y.noise.0.std",
            "outputs.y.noise`: set the whole list; `measurement` has sampl",
        ),
        ("nois.0.std", "the file has time, plant, measurement, observers"),
        ("panels.0.state", "the file has time, plant, measurement, observers. Did you mean `figures.NAME.panels`?"),
    ):
        with pytest.raises(ConfigError) as caught:
            base.varied({path: 1})
        assert message in str(caught.value)


@pytest.mark.parametrize("key", ["quality", "plausible"])
def test_an_input_has_nothing_that_judges_its_values(key: str) -> None:
    told = belongs(("data", "inputs", "F"), key)
    assert told.endswith("values that stand for none are left out by `data.inputs.F.csv: {missing: [...]}`.")
    assert "outputs" not in told


def test_outliers_are_no_faults_of_a_file() -> None:
    told = " Outliers are left out by `gate` or `plausible` of an output."
    assert belongs(("data", "faults"), "outliers") == belongs(("data", "outputs", "S", "faults"), "spike") == told
    assert belongs(("data", "faults"), "stuck") == ""


def test_how_late_samples_are_is_a_column_of_recorded_data() -> None:
    told = " The column of times at which samples are known is `data.outputs.S.available`."
    assert belongs(("data", "outputs", "S"), "delay") == told
    assert belongs(("data", "inputs", "F"), "delay") == ""
