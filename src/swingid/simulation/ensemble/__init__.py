"""Many closed loops at once, arranged for the processor's vector units."""

from swingid.simulation.ensemble.ensemble import Ensemble, ensemble_chunks, simulate_ensemble

__all__ = ["Ensemble", "ensemble_chunks", "simulate_ensemble"]
