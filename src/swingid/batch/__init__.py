"""Estimators for many logs of one rate and length at once: plain arrays in, arrays out."""

from swingid.batch.energy import energy_batch
from swingid.batch.momentum import momentum_batch
from swingid.batch.plan import Batch, Plan, plan_batch

__all__ = ["Batch", "Plan", "energy_batch", "momentum_batch", "plan_batch"]
