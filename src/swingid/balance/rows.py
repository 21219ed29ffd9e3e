"""The balance of terms on modulating functions φ: equation (I), or its form for direct drive and free decay.

    a11 ∫φ'' q1 + b ∫φ sin q1 + ∫φ F = −a12 ∫φ'' q2    (reaction wheel; THEORY: momentum on modulating functions)
    a11 ∫φ'' q1 + b ∫φ sin q1 + ∫φ F = ∫φ τ            (direct drive)
    a11 ∫φ'' q1 + ∫φ F = −b ∫φ sin q1                  (free decay)

Only angles enter; the speed is needed only inside the friction terms.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from swingid.model.equation import shifted
from swingid.model.rig import Rig
from swingid.model.terms import RigTerm, gravity_term, rig_terms
from swingid.numerics.arrays import Array, Bools, Ints, quantile
from swingid.numerics.blocks import BlockNodes
from swingid.numerics.once import once
from swingid.numerics.quadrature import GaussNodes
from swingid.numerics.spline import spline_at, spline_slopes
from swingid.numerics.test_functions import (
    neighbour_overlaps,
    project,
    project_impulses,
    project_stacked,
    project_steps,
)
from swingid.preparation.encoders import Encoders, moved
from swingid.preparation.motion import Motion
from swingid.preparation.speed import speed_on_grid
from swingid.recording.recording import Recording

BLOCK = 1 / 8
"""Length of the blocks of rows, of the time in which the quickest turn of the motion passes."""

FEWEST_BLOCKS = 4
"""Blocks in half a window, at least."""

COMPUTED = ("stacked", "fastest", "finely", "longest_step", "cosine", "slopes", "pulls")
"""Properties of `Signals` that depend neither on the turning points nor on what is declared of the encoders."""

REACH = 8
"""Windows, one of them with itself, over which noise that they share is counted; from there on they are apart."""

FINE = 1 / 6
"""Length of the blocks that resolve the friction near rest, of those of the signals."""


@dataclass(frozen=True)
class Windows:
    """Supports of the modulating functions (test functions): centres and half-lengths in s."""

    centres: Array
    half: Array

    def __len__(self) -> int:
        return len(self.centres)

    def select(self, keep: Bools) -> Windows:
        """The windows where `keep` is true."""
        return Windows(self.centres[keep], self.half[keep])

    @cached_property
    def middle(self) -> float:
        """The median half-length, or the one above it, of few."""
        return float(np.sort(self.half)[len(self.half) // 2])

    @cached_property
    def loudness(self) -> Array:
        """Factor of white noise in ∫φ'' of each window: half^(−3/2)."""
        result: Array = 1.0 / (self.half * np.sqrt(self.half))
        return result

    @cached_property
    def neighbours(self) -> Array:
        """What white noise gives each window in common with itself and the next ones, see `neighbour_overlaps`."""
        return neighbour_overlaps(self.centres, self.half, REACH)


@dataclass(frozen=True)
class Signals:
    """The signals of the balance at the Gauss nodes of blocks of rows; computed once for all windows."""

    nodes: BlockNodes
    angle: Array
    angle_values: Array
    angle_slopes: Array
    speed: Array
    wheel: Array | None
    wheel_values: Array | None
    wheel_slopes: Array | None
    torque: Array | None
    edges: Array
    directions: Array
    motion: Motion
    linear: bool
    source: tuple[Recording, Rig]
    encoders: Encoders
    longest: float
    terms: Mapping[str, RigTerm]

    @cached_property
    def stacked(self) -> tuple[tuple[str, ...], Array, Ints]:
        """Columns of the balance for `project_stacked`: names, values, and the derivatives of φ that they meet."""
        size = np.abs(self.speed)
        columns = {
            "inertia": (self.angle, 2),
            "viscous": (-self.angle, 1),
            "quadratic": (self.speed * size, 0),
            "cubic": (self.speed * size * size, 0),
            "viscous_even": (size, 0),
        }
        if self.wheel is not None:
            columns["wheel"] = (self.wheel, 2)
        elif self.torque is not None:
            columns["torque"] = (self.torque, 0)
        for term in self.terms.values():
            columns |= {name: (column, 0) for name, column in smooth_columns(term, self.angle, self.speed).items()}
        orders = np.array([order for _, order in columns.values()])
        return tuple(columns), np.stack([x.ravel() for x, _ in columns.values()]), orders

    def earlier(self, late: Array) -> Signals:
        """The same signals with every turning point `late` seconds earlier (one value each)."""
        motion = self.motion.earlier(late)
        edges, directions = motion.directions(self.nodes.time[0], self.nodes.time[-1])
        return self._changed(motion=motion, edges=edges, directions=directions)

    def declaring(self, encoders: Encoders) -> Signals:
        """The same signals, of encoders of which other uncertainties are declared."""
        return self._changed(encoders=encoders)

    def _changed(self, **changes: Any) -> Signals:
        """The same signals with other fields, on which COMPUTED does not depend: that is computed once."""
        changed = replace(self, **changes)
        changed.__dict__.update({name: getattr(self, name) for name in COMPUTED})
        return changed

    @cached_property
    def longest_step(self) -> float:
        """Longest interval between stamps (s)."""
        return float(np.max(np.diff(self.nodes.stamps)))

    def gaps(self, least: float) -> Array:
        """Intervals between stamps that are longer than `least` (s): their begins and ends, (gaps, 2)."""
        if self.longest_step <= least:
            return np.empty((0, 2))
        k = np.nonzero(np.diff(self.nodes.stamps) > least)[0]
        return np.column_stack([self.nodes.stamps[k], self.nodes.stamps[k + 1]])

    @cached_property
    def wheel_rate(self) -> Array | None:
        """Speed of the wheel from its angle, at the nodes."""
        if self.wheel_values is None or self.wheel_slopes is None:
            return None
        return self.nodes.cubics(self.wheel_values, self.wheel_slopes, derivative=1)

    @cached_property
    def level_shapes(self) -> dict[str, Array]:
        """Errors at the nodes, per unit, of what is unknown of an integrated rate, by name."""
        instants = self.nodes.flat[0].reshape(self.angle.shape)
        unknowns = {} if self.encoders.level is None else self.encoders.level.unknowns(instants)
        return {name: unknown.shape for name, unknown in unknowns.items()}

    @cached_property
    def fastest(self) -> float:
        """Speed that is exceeded for a thousandth of the time only."""
        return quantile(np.abs(self.speed).ravel(), 0.999)

    @cached_property
    def finely(self) -> tuple[GaussNodes, Array]:
        """Nodes of shorter blocks and the speed at them, for functions of the speed that change quickly near rest."""
        nodes = GaussNodes(BlockNodes.of(self.nodes.stamps, FINE * self.longest).time, 3)
        return nodes, self.motion.speed.at_nodes(nodes)

    @cached_property
    def cosine(self) -> Array:
        """Cos q1 at the nodes."""
        result: Array = np.cos(self.angle)
        return result

    @cached_property
    def slopes(self) -> dict[str, Array]:
        """Derivatives of the terms by the angle at the nodes, per unit of their coefficients."""
        return {name: term.stiffness(self.angle) for name, term in self.terms.items()}

    @cached_property
    def pulls(self) -> dict[str, float]:
        """Means of `slopes`, by which noise of the angle enters the terms."""
        return {name: float(np.mean(slope)) for name, slope in self.slopes.items()}

    def stiffness(self, value: Callable[[str], float]) -> Array:
        """Change of the conservative torques per rad or m at the nodes; value: of a coefficient by its name."""
        values = {name: value(name) for name, term in self.terms.items() if term.term.is_conservative}
        pulls = (coefficient * self.slopes[name] for name, coefficient in values.items() if coefficient)
        return sum(pulls, np.zeros_like(self.angle))

    @cached_property
    def edge_angles(self) -> Array:
        """Angle at the turning points, and at the start of the log before them."""
        return spline_at(self.nodes.stamps, self.angle_values, self.angle_slopes, self.edges[:-1], 0)

    def stopped(self, width: float) -> Array:
        """Stop operator at the nodes: the way since a reversal (rad or m), up to ± `width`, where a cable slips."""
        held = [0.0]
        for direction in np.diff(self.edge_angles):
            held.append(min(max(held[-1] + float(direction), -width), width))
        place = self.since
        whole = np.array(held)[place] + self.angle.ravel() - self.edge_angles[place]
        return np.clip(whole, -width, width).reshape(self.angle.shape)

    @cached_property
    def since(self) -> Ints:
        """Return, for every node, flattened, which of the edges is the last before it."""
        after = np.searchsorted(self.edges, self.nodes.flat[0], side="right") - 1
        return np.clip(after, 0, len(self.directions) - 1)

    def grid_errors(self, resolution: float) -> Array:
        """Errors of the angle on grids of this step shifted by eighths of it, times the nodes' weights: (8, nodes)."""
        return _grid_errors(self.nodes, self.angle_values, 0.75 * self.motion.speed.half_width, resolution)

    def suited(self, half: float) -> Signals:
        """These signals, or on shorter blocks where half-lengths of `half` (s) need them."""
        if half >= FEWEST_BLOCKS * self.longest:
            return self
        return Signals.of(*self.source, self.motion, self.encoders, longest=half / (2 * FEWEST_BLOCKS), known=self)

    @classmethod
    def of(
        cls,
        log: Recording,
        rig: Rig,
        motion: Motion,
        encoders: Encoders,
        *,
        longest: float | None = None,
        known: Signals | None = None,
    ) -> Signals:
        """Signals of a log at the nodes of blocks no longer than `longest` (s), on the clock of the angle.

        By default they are short beside the quickest turn of the motion. known: the same on other blocks.
        """
        longest = BLOCK * motion.quickest if longest is None else longest
        nodes = BlockNodes.of(log.time, longest)
        late = encoders.angle.latency.value
        wheel = wheel_values = wheel_slopes = None
        if known is not None:
            slopes, wheel_values, wheel_slopes = known.angle_slopes, known.wheel_values, known.wheel_slopes
        elif rig.drive.wheel is not None and log.wheel_angle is not None:
            wheel_values = moved(log.time, log.wheel_angle, encoders.wheel.latency.value - late)
            slopes, wheel_slopes = spline_slopes(log.time, np.stack([log.angle, wheel_values]))
        else:
            slopes = spline_slopes(log.time, log.angle)
        angle = nodes.cubics(log.angle, slopes)
        if wheel_values is not None and wheel_slopes is not None:
            wheel = nodes.cubics(wheel_values, wheel_slopes)
        torque = None
        if rig.drive.channel == "torque" and log.torque is not None:
            # on the angle's clock: a torque that acts at t is met by the angle in the row stamped t − late
            held = log.drive_held
            torque = nodes.hold(log.torque, late) if held else nodes.spline(moved(log.time, log.torque, -late))
        edges, directions = motion.directions(log.time[0], log.time[-1])
        return cls(
            nodes=nodes,
            angle=angle,
            angle_values=log.angle,
            angle_slopes=slopes,
            speed=motion.speed.at_nodes(nodes),
            wheel=wheel,
            wheel_values=wheel_values,
            wheel_slopes=wheel_slopes,
            torque=torque,
            edges=edges,
            directions=directions,
            motion=motion,
            linear=rig.axis.kind == "linear",
            source=(log, rig),
            encoders=encoders,
            longest=longest,
            terms={term.name: term for term in (gravity_term(rig), *rig_terms(rig))},
        )


@once
def _grid_errors(nodes: BlockNodes, angles: Array, width: float, resolution: float) -> Array:
    """See `Signals.grid_errors`, by local cubics of this half-width (s)."""
    # at the instants of the rows: where their rate is near a multiple of the motion's, errors repeat; and smoothed over
    # many steps, for the rounding of the measured angle is what repeats at every turn; the motion that smoothing
    # removes is smoothed and added (Tukey's twicing)
    smooth = speed_on_grid(nodes.stamps, angles, 0.0, width, 1.5).angle_at(nodes.stamps)
    rows = smooth + speed_on_grid(nodes.stamps, angles - smooth, 0.0, width, 1.5).angle_at(nodes.stamps)
    return nodes.rounded(rows[:-1] / resolution) * (nodes.flat[1] * resolution)


@dataclass(frozen=True)
class Rows:
    """One equation per window: of every term the modulated integral (windows,), by the name of the term.

    inertia ∫φ'' q1 (= ∫φ q1''), gravity_torque ∫φ sin q1, wheel ∫φ'' q2, torque ∫φ τ; friction coulomb ∫φ sgn v,
    viscous ∫φ v, quadratic ∫φ v|v|, cubic ∫φ v³, offset ∫φ, viscous_even ∫φ |v|; memory Σ w φ(reversal)·new direction
    with the weights w of `Motion.reversals`, memory_equal the same with 1 − w; ∫φ f of the terms in the registry, and
    under their names with "'" behind ∫φ ∂f/∂shift. pulls: mean ∂f/∂q1 of the terms that depend on the angle, by which
    its noise enters them. kept: what errors of channels add to each term, see `errors`.
    """

    windows: Windows
    columns: Mapping[str, Array]
    pulls: Mapping[str, Any] = field(default_factory=dict)
    kept: dict[tuple[str, str], Array] = field(default_factory=dict, repr=False, compare=False)

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]

    def __len__(self) -> int:
        return len(self.windows)

    def select(self, keep: Bools) -> Rows:
        """The rows where `keep` is true."""
        columns = {name: column[keep] for name, column in self.columns.items()}
        return replace(self, windows=self.windows.select(keep), columns=columns, kept={})

    def beside(self, columns: Mapping[str, Array]) -> Self:
        """The rows with more columns, or others."""
        return replace(self, columns={**self.columns, **columns})

    def sum_of(self, values: Mapping[str, float]) -> Array:
        """Σ value · column over these terms (windows,)."""
        return sum((value * self.columns[name] for name, value in values.items() if value), np.zeros(len(self)))


def rows_of(signals: Signals, windows: Windows) -> Rows:
    """Modulated integrals of the balance on `windows`, which must lie inside the log."""
    names, stacked, orders = signals.stacked
    integrals = project_stacked(signals.nodes, stacked, orders, windows.centres, windows.half)
    columns = dict(zip(names, integrals.T, strict=True))
    columns["offset"] = windows.half * (32 / 35)
    return Rows(windows, columns | _jumps(signals, windows), signals.pulls)


def smooth_columns(term: RigTerm, angle: Array, speed: Array) -> dict[str, Array]:
    """Regressor of a term that does not jump at a reversal, and where its shift is uncertain ∂f/∂shift."""
    if term.term.is_dry:
        return {}
    columns = {term.name: term.regressor(angle, speed, np.sign(speed))}
    if term.shift.std:
        columns[shifted(term.name)] = term.term.of_speed(speed) * term.term.shift_slope(angle, *term.at)
    return columns


def dry_column(signals: Signals, windows: Windows, at_nodes: Array, at_edges: Array) -> Array:
    """∫φ g sgn q1' of a factor g, given at the nodes and at the edges of the swings (all but the last).

    The jumps are separated as steps, which are integrated exactly; the rest is smooth to its first derivative, for the
    speed is 0 there.
    """
    edges, directions = signals.edges, signals.directions
    steps = np.cumsum(np.diff(directions, prepend=0.0) * at_edges)
    place = signals.since
    remaining = (directions[place] * at_nodes.ravel() - steps[place]).reshape(signals.angle.shape)
    smooth = project(signals.nodes, [(remaining, 0)], windows.centres, windows.half)[:, 0]
    result: Array = smooth + project_steps(edges, steps, windows.centres, windows.half)
    return result


def retimed(rows: Rows, signals: Signals) -> Rows:
    """The rows with their terms at the turning points evaluated for the turning points of `signals`."""
    return rows.beside(_jumps(signals, rows.windows))


def _jumps(signals: Signals, windows: Windows) -> dict[str, Array]:
    """The columns that depend on the turning points: dry friction, and an impulse at each reversal."""
    instants, directions, weights = signals.motion.reversals
    strengths = np.stack([directions * weights, directions * (1.0 - weights)])
    memory, equal = project_impulses(instants, strengths, windows.centres, windows.half)
    by_name = {
        "coulomb": project_steps(signals.edges, signals.directions, windows.centres, windows.half),
        "memory": memory,
        "memory_equal": equal,
    }
    for name, term in signals.terms.items():
        if term.term.is_dry:
            at_nodes = term.term.of_angle(signals.angle, *term.at)
            by_name[name] = dry_column(signals, windows, at_nodes, term.term.of_angle(signals.edge_angles, *term.at))
    return by_name
