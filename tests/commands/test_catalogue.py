"""What `list` and `show` tell."""

from __future__ import annotations

import json

import pytest

from hgorun.commands.catalogue import show
from hgorun.commands.catalogue_options import Show


def shown(name: str, capsys: pytest.CaptureFixture[str]) -> str:
    show(Show(name=name, json=False))
    return capsys.readouterr().out


def test_a_plant_lists_states_and_outputs_in_their_order(capsys: pytest.CaptureFixture[str]) -> None:
    text = shown("qube_pendulum", capsys)
    assert "states: theta [rad], alpha [rad], theta_dot [rad/s], alpha_dot [rad/s]\n" in text
    assert "outputs: theta [rad], alpha [rad]\n" in text
    assert "  V [V]  voltage of the motor\n" in text


def test_states_without_units_are_listed_too(capsys: pytest.CaptureFixture[str]) -> None:
    assert "states: x1, x2\noutputs: x1\n" in shown("van_der_pol", capsys)


def test_what_has_no_source_names_none(capsys: pytest.CaptureFixture[str]) -> None:
    assert "source" not in shown("gaussian", capsys)


def test_states_are_in_json(capsys: pytest.CaptureFixture[str]) -> None:
    show(Show(name="contois", json=True))
    found = json.loads(capsys.readouterr().out)
    assert (found["states"], found["outputs"]) == (["x1", "x2"], ["x1"])


def test_keys_of_a_key_are_listed_below_it(capsys: pytest.CaptureFixture[str]) -> None:
    text = shown("sinusoids", capsys)
    assert "  terms (required): " in text
    assert "\n    omega (required): angular frequency, rad per time unit\n    phase (default 0.0): rad\n" in text
    show(Show(name="sinusoids", json=True))
    (terms,) = json.loads(capsys.readouterr().out)["keys"]
    assert [key["key"] for key in terms["keys"]] == ["amplitude", "omega", "phase"]
