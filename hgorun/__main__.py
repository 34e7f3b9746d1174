"""``python -m hgorun``."""

from hgorun.cli import main

main()
