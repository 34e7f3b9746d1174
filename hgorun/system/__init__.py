"""Plant and observers joined into the one system that the engine compiles."""

from hgorun.system.block import ObserverBlock
from hgorun.system.build import Signal, System, build_system

__all__ = ["ObserverBlock", "Signal", "System", "build_system"]
