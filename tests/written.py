"""A configuration as text, for tests of what is read and where it stood."""

EXAMPLE = """\
title: Contois, sampled
time: {end: 40, output_step: 0.01, unit: h}
plant:
  type: contois
  initial:
    x1: 1.5
    x2: 15
measurement:
  noise:
    - type: sinusoids
      terms: [{amplitude: 0.5, omega: 11.938},
              {amplitude: 0.5, omega: 12.189}]
observers:
  SHGO: {type: shgo, theta: 1, poles: -1}
  FHGO r=2: {type: fhgo2, theta: 2, r: 2}
disturbance:
"""
