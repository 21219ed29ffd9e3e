"""Campaigns: one experiment many times with something varied, and what the methods make of it."""

from __future__ import annotations

from swingid.study.campaign.loading import READY, load_plan
from swingid.study.campaign.plan import Plan
from swingid.study.campaign.run import run_campaign
from swingid.study.campaign.summary import Summary, summarise

__all__ = ["READY", "Plan", "Summary", "load_plan", "run_campaign", "summarise"]
