"""The digital twin: one closed loop, sampled controller, held voltage."""

from swingid.simulation.twin import Run, Truth, simulate, simulate_run

__all__ = ["Run", "Truth", "simulate", "simulate_run"]
