"""Hypotheses in competition: what may have happened at a sample, at which log_rate, and which explanation is used.

Each candidate is the hypothesis that the happening leaves, made first and judged by the likelihood of the readings
under it; only where all loads are gone, readings are compared with the model in open loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

import record
from observer_filter import NOBODY, Hypothesis, Jump, Motion, Plant, Reading, Seen, bounded

if TYPE_CHECKING:
    from collections.abc import Callable


class ModelRun:
    """What the plant would do under the commands alone, or with the usual loads, and how far that is right."""

    def __init__(self, plant: Plant, settings: dict, tuning: dict) -> None:
        """Rests at the operating point."""
        at = plant.layout
        self.settings, self.tuning = settings, tuning
        self.x, self.loads, self.gains = plant.x0, np.zeros(at.loads), np.zeros(at.m)
        self.came_from = (plant.x0, np.zeros(at.d))
        self.allowed = plant.output_variance.copy()
        self.error = plant.output_variance.copy()
        self.y, self.bound, self.spread = np.zeros(at.p), np.zeros((at.p, at.p)), np.zeros(at.p)

    def variances(self, plant: Plant) -> np.ndarray:
        """Returns the variance of each state that the model's error allows."""
        start = self.tuning["start_deviations"] * np.array(self.settings["start"])
        return (self.settings["model_error"] * (self.x - plant.x0)) ** 2 + start**2

    @property
    def share(self) -> np.ndarray:
        """How large the error of each output has been, relative to what is allowed."""
        return np.clip(
            self.error / np.maximum(self.allowed, 5e-324), self.tuning["run_share_least"], self.tuning["run_share_most"]
        )

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the outputs, by what the error has been so far."""
        return np.sqrt(np.outer(self.share, self.share)) * self.bound

    def read(self, plant: Plant, wave: np.ndarray, noise: np.ndarray) -> None:
        """Forms the outputs of the sample, with the disturbance as the leading hypothesis knows it."""
        self.y = plant.output(self.x, wave)
        self.bound = plant.C @ np.diag(self.variances(plant)) @ plant.C.T
        self.spread = noise**2 + self.share * np.diag(self.bound)

    def advance(self, plant: Plant, wave: np.ndarray, u: np.ndarray) -> None:
        """Moves one sample on under input `u`."""
        self.came_from = (self.x, wave)
        self.repeat(plant, u)

    def repeat(self, plant: Plant, u: np.ndarray) -> None:
        """Makes the last sample's move, perhaps in another mode."""
        x, wave = self.came_from
        moved = plant.A @ x + plant.B @ ((1.0 + self.gains) * u) + plant.Ed @ wave + plant.G @ self.loads + plant.a
        self.x = bounded(moved)

    def displaced(self, output: np.ndarray, limit: float) -> frozenset[int]:
        """Returns the sensors whose outputs are far from the run."""
        return frozenset(np.flatnonzero((output - self.y) ** 2 > limit * self.spread).tolist())

    def learn(self, output: np.ndarray) -> None:
        """Learns the error of the run."""
        memory = self.tuning["run_memory"]
        self.error = self.error + ((output - self.y) ** 2 - self.error) / memory
        self.allowed = self.allowed + (np.diag(self.bound) - self.allowed) / memory

    def learn_loads(self, loads: np.ndarray, gains: np.ndarray) -> None:
        """Learns which loads are usual."""
        memory = self.tuning["usual_load"]
        self.loads = self.loads + (loads - self.loads) / memory
        self.gains = self.gains + (gains - self.gains) / memory


class Repeats:
    """Evidence that a sensor shows one value, about its mean, where the leading hypothesis expects motion."""

    def __init__(self, outputs: int, tuning: dict) -> None:
        """Has seen nothing."""
        self.tuning = tuning
        self.evidence, self.before = np.zeros(outputs), np.zeros(outputs)
        self.mean, self.count = np.zeros(outputs), np.zeros(outputs)
        self.value, self.moved_from = np.zeros(outputs), np.zeros(outputs)

    def watch(self, h: Hypothesis, seen: Seen, reading: Reading, run: ModelRun) -> None:
        """Takes a sample in: the likelihood of a constant against that of the hypothesis."""
        self.before = self.evidence.copy()
        for q, y in enumerate(reading.y):
            if reading.valid[q] and y != self.value[q]:
                self.value[q], self.moved_from[q] = y, run.y[q]
            if not reading.valid[q] or q in h.stuck:
                self.evidence[q] = self.count[q] = 0.0
                continue
            moved = (run.y[q] - self.moved_from[q]) ** 2
            if self.count[q] == 0.0:
                self.mean[q], self.count[q], self.evidence[q] = y, 1.0, 0.0
                continue
            variance = reading.noise[q] ** 2
            surprise = min(seen.r[q] ** 2 / seen.S[q, q], 50.0)
            off = y - self.mean[q]
            gain = 0.5 * surprise - 0.5 * off**2 / (variance * (1.0 + 1.0 / self.count[q])) - 0.02
            if moved > self.tuning["displaced"] * variance:
                gain = max(gain, self.tuning["repeat_evidence"])
            self.evidence[q] += gain
            if self.evidence[q] <= 0.0:
                self.evidence[q], self.mean[q], self.count[q] = 0.0, y, 1.0
            else:
                self.count[q] += 1.0
                self.mean[q] += off / min(self.count[q], 200.0)


@dataclass
class Candidate:
    """Something that may have happened to a hypothesis; `make` returns what it leaves, none where all goes on."""

    name: str
    score: float
    parent: int
    convinced: bool
    kinds: tuple[frozenset[int], ...]
    plant_changed: bool
    misfit_penalty: float = 0.0
    make: Callable[[], Hypothesis] | None = None

    @property
    def flagged(self) -> frozenset[int]:
        """The sensors that it takes for faulty."""
        return frozenset().union(*self.kinds)


@dataclass
class Trial:
    """What a candidate would leave, and what the sample says of it."""

    child: Hypothesis
    seen: Seen


class Bank:
    """The state-based estimator of a design record."""

    def __init__(self, design: dict, mode: int) -> None:
        """Rests at the operating point of `mode`; where the mode is not told, at that of any other as well."""
        estimator = design["controller"]["estimator"]
        self.settings = estimator["hypotheses"]
        self.tuning = estimator["tuning"]["bank"]
        fitted = self.settings.get("fitted") or []
        modes = record.modes(design)
        te = record.sample_time(design)
        self.plants = [Plant(m, self.settings, te, fitted[i] if fitted else None) for i, m in enumerate(modes)]
        self.at = self.plants[0].layout
        self.trusts_model = self.settings["ambiguous"] == "trust-model"
        self.outputs_may_err = self.at.p > self.at.n
        self.log_rate = {
            name: math.log(self.settings[name + "_rate"]) for name in ("fault", "stuck", "release", "change", "load")
        }
        rate = self.settings.get("mode_rate")
        self.finds_mode = rate is not None
        self.mode_log_rate = math.log(rate) if self.finds_mode else 0.0
        order = [mode, *(k for k in range(len(modes)) if k != mode and self.finds_mode)]
        self.hypotheses = [self._at_rest(k) for k in order]
        self.seen: dict[int, Seen] = {}
        self.best = self.hypotheses[0]
        self.mode = self.moved_by = mode
        self.probability = np.zeros(len(modes))
        self.u, self.moved = self.plants[mode].u0, np.zeros(self.at.m)
        self.first = True
        p = self.at.p
        self.noise_ratio = np.full(p, self.tuning["noise_at_start"])
        self.noise_samples = self.tuning["noise_prior"]
        self.noise = np.zeros(p)
        self.model_share = np.ones(len(modes))
        self.model_samples = np.full(len(modes), self.tuning["model_prior"])
        self.from_model = np.zeros(p)
        self.repeats = Repeats(p, self.tuning)
        # Whose reading repeats, whose does so no more, and the leading hypothesis without the readings that repeat.
        self.repeating = self.resumed = NOBODY
        self.without_repeats: tuple[Hypothesis, Seen] | None = None
        self.unloaded, self.usual = (ModelRun(self.plants[mode], self.settings, self.tuning) for _ in range(2))
        self.apart = self.suspect = self.flagged = NOBODY
        self.misfit, self.model_valid = float(p), True
        self.expected, self.residual, self.load = np.zeros(p), np.zeros(p), np.zeros(self.at.m)
        self.actuator_fault = np.zeros(self.at.m, dtype=bool)
        # What was taken for possible so far; by how much the explanation used was likelier than the next, where there
        # was another: how close the decision was at this sample.
        self.kept: set[str] = set()
        self.lead = math.inf

    def _at_rest(self, mode: int) -> Hypothesis:
        plant, at, settings = self.plants[mode], self.at, self.settings
        deviation = np.zeros(at.size)
        deviation[at.x] = settings["start"]
        deviation[at.wave] = settings["disturbance_size"]
        deviation[at.load] = self.tuning["load_at_start"] * plant.load_size
        deviation[at.gain] = self.tuning["load_at_start"] * settings["gain_error"]
        z = np.zeros(at.size)
        z[at.x] = plant.x0
        return Hypothesis(z, np.diag(deviation**2), plant.x0.copy(), mode, mode, float(at.p))

    # One sample.

    def observe(self, told: int, y: np.ndarray) -> None:
        """Judges the readings of a sample; not-a-number is no reading."""
        self.noise = np.array(self.settings["noise"]) * np.sqrt(self.noise_ratio)
        reading = Reading(y, np.isfinite(y), self.noise)
        if not self.finds_mode:
            self._tell(told)
        self._set_aside(reading)
        for run in (self.unloaded, self.usual):
            run.read(self.plants[self.best.mode], self.best.z[self.at.wave], self.noise)
        self.seen = {id(h): self._predict(h, reading) for h in self.hypotheses}
        leading = self.hypotheses[0]
        self.repeats.watch(leading, self.seen[id(leading)], reading, self.unloaded)
        self._learn_model_error(leading, reading)
        if self._nothing_happened(leading):
            self._go_on()
        else:
            self._compete(reading)
        if self.without_repeats:
            h, seen = self.without_repeats
            h.misfit += self.tuning["misfit_share"] * (min(seen.square, 1e3) - h.misfit)
            h.update(seen)
        self.first = False
        self.mode = self.best.mode
        self._correct_model_runs()
        self._learn_noise(reading)
        self._conclude(reading)

    def _set_aside(self, reading: Reading) -> None:
        before = self.repeating
        again = reading.valid & (reading.y == self.repeats.value) & (not self.first)
        self.repeating = frozenset(np.flatnonzero(again).tolist())
        self.resumed = frozenset(q for q in before - self.repeating if reading.valid[q])
        if not self.repeating:
            self.without_repeats = None
            return
        leading = self.hypotheses[0]
        h = self.without_repeats[0] if self.without_repeats else None
        if h is None or (h.kinds, h.plant_changed, h.mode) != (leading.kinds, leading.plant_changed, leading.mode):
            h = leading.copy()
        self.without_repeats = (h, self._predict(h, Reading(reading.y, reading.valid & ~again, reading.noise)))

    def before_it_froze(self, q: int) -> Hypothesis | None:
        """Returns what the leading hypothesis is without the readings that repeat, where it fits and `q` is one."""
        fits = self.without_repeats is not None and self.without_repeats[0].misfit < 3.0 * self.at.p + 6.0
        return self.without_repeats[0] if fits and q in self.repeating else None

    def _predict(self, h: Hypothesis, reading: Reading) -> Seen:
        return h.predict(self.plants[h.mode], reading, outputs_may_err=self.outputs_may_err)

    def _nothing_happened(self, leading: Hypothesis) -> bool:
        seen = self.seen[id(leading)]
        return (
            not leading.flagged
            and not leading.plant_changed
            and seen.regular
            and seen.square < self.tuning["quiet_beside"] + self.tuning["quiet_per_output"] * self.at.p
            and bool(np.all(self.repeats.evidence < self.tuning["frozen_evidence"]))
            and not self.first
            and not self.apart
            and not (self.trusts_model and self.suspect)
            and self._leads_alone(leading)
        )

    def _leads_alone(self, leading: Hypothesis) -> bool:
        after = {id(h): h.score + self.seen[id(h)].likelihood for h in self.hypotheses}
        return all(
            self._stands_for(h, leading, h.mode) and h.mode != leading.mode and after[id(h)] <= after[id(leading)]
            for h in self.hypotheses[1:]
        )

    @staticmethod
    def _stands_for(h: Hypothesis, leading: Hypothesis, mode: int) -> bool:
        return h.mode == mode and h.kinds == leading.kinds and h.plant_changed == leading.plant_changed and h.convinced

    def _go_on(self) -> None:
        leading = self.hypotheses[0]
        lead = leading.score + self.seen[id(leading)].likelihood
        for h in self.hypotheses:
            seen = self.seen[id(h)]
            h.score += seen.likelihood - lead
            h.update(seen)
            h.misfit += self.tuning["misfit_share"] * (min(seen.square, 1e3) - h.misfit)
        leading.score = 0.0
        self.best, self.suspect, self.lead = leading, NOBODY, math.inf
        if self.finds_mode:
            self._weigh_modes()

    # What may have happened.

    def _compete(self, reading: Reading) -> None:
        candidates: list[Candidate] = []
        for index, h in enumerate(self.hypotheses):
            candidates += Proposals(self, index, h, reading).all()
        kept = self._select(sorted(candidates, key=lambda c: -c.score))
        children = []
        for candidate in kept:
            h = candidate.make() if candidate.make else self.hypotheses[candidate.parent]
            seen = self._predict(h, reading) if candidate.make else self.seen[id(h)]
            children.append((candidate, h, seen))
        for candidate, h, seen in children:
            h.update(seen)
            h.score, h.convinced = candidate.score, candidate.convinced
            h.misfit += self.tuning["misfit_share"] * (min(seen.square, 1e3) + candidate.misfit_penalty - h.misfit)
        self.hypotheses = [h for _, h, _ in children]
        self.seen = {id(h): seen for _, h, seen in children}
        self._decide(reading)

    def _select(self, candidates: list[Candidate]) -> list[Candidate]:
        """Returns the best, few of a kind, and always one without a fault whose plant is the model; scores anew."""
        most = max(c.score for c in candidates if c.convinced)
        margin = self.settings["odds"] - min(self.log_rate["fault"], self.log_rate["load"])
        kept: list[Candidate] = []
        plain = False
        for c in candidates:
            is_plain = not c.flagged and not c.plant_changed and bool(c.convinced)
            stays = c.score >= most - margin and len(kept) < self.tuning["kept"] - (not plain)
            if not stays and (plain or not is_plain):
                continue
            mode = self.hypotheses[c.parent].mode
            kind = (c.flagged, c.plant_changed, c.convinced, mode)
            alike = sum((o.flagged, o.plant_changed, o.convinced, self.hypotheses[o.parent].mode) == kind for o in kept)
            if alike >= self.tuning["per_sensor_set"] or self._is_twin(c, kept):
                continue
            plain = plain or is_plain
            kept.append(c)
            self.kept.add(c.name)
        reach = self.tuning["unflagged_range"]
        for c in kept:
            c.score = float(np.clip(c.score - most, -reach, reach))
        return kept

    def _is_twin(self, candidate: Candidate, kept: list[Candidate]) -> bool:
        """Whether one goes on from the same estimate under the same assumptions."""
        if candidate.make:
            return False
        h, share = self.hypotheses[candidate.parent], self.tuning["same_estimate"]
        for other in kept:
            o = self.hypotheses[other.parent]
            same = (o.kinds, o.plant_changed, o.convinced, o.mode) == (h.kinds, h.plant_changed, h.convinced, h.mode)
            twins = not other.make and same and o.has_estimate(h.z, share)
            if twins and self.seen[id(o)].leaves(self.seen[id(h)].r, share):
                return True
        return False

    # Which explanation is used.

    def _decide(self, reading: Reading) -> None:
        """A sensor's fault must beat the best explanation without one by its odds."""
        mode, p = self._decide_mode(), self.at.p
        eligible: list[tuple[float, Hypothesis]] = []
        for h in self.hypotheses:
            value = h.score - (self.settings["odds"] if h.flagged and not self.trusts_model else 0.0)
            fits = not h.flagged or (h.misfit < 3.0 * p + 6.0 and self.seen[id(h)].square < 20.0 + 4.0 * p)
            if h.convinced and fits and h.mode == mode:
                eligible.append((value, h))
        self.best = self.hypotheses[0]
        if eligible:
            ranked = sorted(eligible, key=lambda pair: -pair[0])
            self.best = ranked[0][1]
            others = [value for value, h in ranked if h.kinds != self.best.kinds]
            self.lead = ranked[0][0] - others[0] if others else math.inf
        decided = self.best.flagged
        self.suspect = frozenset(
            q
            for h in self.hypotheses
            if h.score >= self.best.score
            for q in h.flagged - decided
            if q not in h.additive or abs(h.z[self.at.fault[q]]) > 6.0 * reading.noise[q]
        )
        where = next(i for i, h in enumerate(self.hypotheses) if h is self.best)
        self.hypotheses[0], self.hypotheses[where] = self.hypotheses[where], self.hypotheses[0]

    def _decide_mode(self) -> int:
        if not self.finds_mode:
            return self.hypotheses[0].mode
        self._weigh_modes()
        likeliest = int(np.flatnonzero(self.probability == self.probability.max())[-1])
        ahead = self.probability[likeliest] > math.exp(self.settings["odds"]) * self.probability[self.mode]
        return likeliest if ahead else self.mode

    def _weigh_modes(self) -> None:
        scores = [(h.mode, h.score) for h in self.hypotheses if h.convinced]
        most = max((score for _, score in scores), default=-math.inf)
        weights = np.zeros(len(self.plants))
        for mode, score in scores:
            weights[mode] += math.exp(min(score - most, 0.0))
        self.probability = weights / weights.sum()

    def _correct_model_runs(self) -> None:
        """Repeats the last move where the plant was in another mode than thought."""
        if self.best.moved_by == self.moved_by:
            return
        self.moved_by = self.best.moved_by
        for run in (self.unloaded, self.usual):
            run.repeat(self.plants[self.moved_by], self.u)
            run.read(self.plants[self.mode], self.best.z[self.at.wave], self.noise)

    def _learn_noise(self, reading: Reading) -> None:
        """The mean of the noise's square, given the innovations of the sensors in use; the design's is the least."""
        seen = self.seen[id(self.best)]
        if not seen.regular:
            return
        tuning = self.tuning
        self.noise_samples = min(self.noise_samples + 1.0, tuning["noise_memory"])
        for q in set(np.flatnonzero(reading.valid)) - self.best.flagged:
            variance = seen.S[q, q]
            share = reading.noise[q] ** 2 / variance
            square = min(seen.r[q] ** 2, tuning["outlier"] * variance)
            relative = share * square / variance + 1.0 - share
            ratio = self.noise_ratio[q] * (1.0 + (relative - 1.0) / self.noise_samples)
            self.noise_ratio[q] = min(max(ratio, 1.0), tuning["noise_limit"])

    def _learn_model_error(self, leading: Hypothesis, reading: Reading) -> None:
        """Fisher scoring for the variance of the model's error, relative to the assumed one."""
        seen, tuning, mode = self.seen[id(leading)], self.tuning, leading.moved_by
        if not seen.regular or leading.plant_changed:
            return
        for q in sorted(set(np.flatnonzero(reading.valid)) - leading.flagged):
            part = self.from_model[q] / seen.S[q, q]
            square = min(seen.r[q] ** 2 / seen.S[q, q], tuning["outlier"])
            self.model_samples[mode] = min(self.model_samples[mode] + part**2, tuning["model_memory"])
            share = self.model_share[mode] * (1.0 + part * (square - 1.0) / self.model_samples[mode])
            self.model_share[mode] = min(max(share, tuning["model_share_least"]), tuning["model_share_most"])

    def _model_error(self, mode: int) -> float:
        """Returns the variance of the relative error of the entries of a mode's matrices, as far as it is known."""
        return self.settings["model_error"] ** 2 * self.model_share[mode]

    def _conclude(self, reading: Reading) -> None:
        at, best, seen = self.at, self.best, self.seen[id(self.best)]
        plant = self.plants[self.mode]
        self.expected = plant.output(best.z[at.x], best.z[at.wave])
        self.flagged = best.flagged | frozenset(np.flatnonzero(~reading.valid).tolist())
        corrected = np.isin(np.arange(at.p), list(best.flagged))
        self.residual = np.where(corrected, reading.y - self.expected, seen.r)
        self.misfit += self.tuning["misfit_share"] * (min(seen.square, 1e3) - self.misfit)
        self.model_valid = self.misfit < 4.0 * at.p and not best.plant_changed
        loads, gains = best.z[at.load], best.z[at.gain]
        self.load = loads[: at.m] + self.u * gains + plant.Bplus @ (plant.G[:, at.m :] @ loads[at.m :])
        self.actuator_fault = np.abs(self.load) > np.array(self.settings["input_load"])
        far = self.unloaded.displaced(self.expected, self.tuning["displaced"])
        self.apart = self.unloaded.displaced(self.expected, self.tuning["returned"])
        self.unloaded.learn(self.expected)
        self.usual.learn(self.expected)
        if not best.flagged and not best.plant_changed:
            self.usual.learn_loads(loads, gains)
        self.suspect = self.suspect | (far - best.flagged)

    # From one sample to the next.

    def advance(self, u: np.ndarray) -> None:
        """Moves one sample on, under the input that acts."""
        self.moved, self.u = u - self.u, u
        for run in (self.unloaded, self.usual):
            run.advance(self.plants[self.mode], self.best.z[self.at.wave].copy(), u)
        self.moved_by = self.mode
        plant = self.plants[self.best.mode]
        changes = self._model_error(self.best.mode) * self.best.unmodelled(plant, self.moved)
        self.from_model = plant.C**2 @ changes
        self._branch(shows_at_once=False)
        errors = [self._model_error(mode) for mode in range(len(self.plants))]
        motion = Motion(u, self.moved, errors, self.outputs_may_err)
        for h in [*self.hypotheses, *([self.without_repeats[0]] if self.without_repeats else [])]:
            h.advance(self.plants[h.mode], self.settings, self.noise, motion)
        self._branch(shows_at_once=True)

    def _branch(self, *, shows_at_once: bool) -> None:
        """Sets a hypothesis for each other mode beside the leading one: entered at this sample, or before."""
        if not self.finds_mode:
            return
        leading = self.hypotheses[0]
        for mode, plant in enumerate(self.plants):
            if mode == leading.mode or self.plants[leading.mode].shows_unlike(plant) != shows_at_once:
                continue
            score = leading.score + self.mode_log_rate
            standing = [h for h in self.hypotheses[1:] if self._stands_for(h, leading, mode)]
            old = max(standing, key=lambda h: h.score, default=None)
            if old and old.score >= score - self.tuning["switch_restart"]:
                continue
            child = leading.copy()
            child.score = score
            self._enter(child, mode)
            if old:
                self.hypotheses[next(i for i, h in enumerate(self.hypotheses) if h is old)] = child
            else:
                self.hypotheses.append(child)

    def _tell(self, mode: int) -> None:
        for h in [*self.hypotheses, *([self.without_repeats[0]] if self.without_repeats else [])]:
            if self.first:
                h.mode = h.moved_by = mode
            elif h.mode != mode:
                self._enter(h, mode)

    def _enter(self, h: Hypothesis, mode: int) -> None:
        """A mode begins: what the model misses there, and what a load does, may differ."""
        plant, at = self.plants[mode], self.at
        error = self._model_error(mode)
        shows_at_once = self.plants[h.mode].shows_unlike(plant)
        h.mode = mode
        on_states = at.load[at.m + at.s :]
        loads, off = h.z[on_states] ** 2, h.z[at.x] - plant.x0
        if shows_at_once:
            h.P[at.x, at.x] += error * off**2
        missed = plant.A**2 @ off**2 + plant.B**2 @ (self.u - plant.u0) ** 2
        h.P[on_states, on_states] += error * missed + 2.0 * np.maximum(loads, loads.mean())


class Proposals:
    """All that may have happened to one hypothesis since the last sample."""

    def __init__(self, bank: Bank, index: int, h: Hypothesis, reading: Reading) -> None:
        """Starts with that all goes on."""
        self.bank, self.index, self.h, self.reading = bank, index, h, reading
        self.plant, self.at, self.tuning, self.log_rate = bank.plants[h.mode], bank.at, bank.tuning, bank.log_rate
        self.seen = bank.seen[id(h)]
        self.unlikely = self.seen.square > min(
            self.tuning["quiet_beside"],
            self.tuning["unlikely_beside"] + self.tuning["unlikely_per_output"] * self.at.p,
        )
        self.fault_size = np.array(bank.settings["fault_size"])
        # What repeated its reading and does so no more has not frozen, unless in another way.
        self.resumed = h.stuck & bank.resumed
        self.stay = h.score + self.seen.likelihood + len(self.resumed) * self.log_rate["stuck"]
        if h is not bank.best and self._has_vanished():
            self.stay -= self.tuning["fading"]
        self.valid = frozenset(np.flatnonzero(reading.valid).tolist())
        self.list = [Candidate("stay", self.stay, index, h.convinced, h.kinds, h.plant_changed)]

    def all(self) -> list[Candidate]:
        """Returns every candidate."""
        self._plant_changes()
        self._faults_begin()
        self._faults_change_or_end()
        return self.list

    def _has_vanished(self) -> bool:
        h = self.h
        if not h.additive or h.additive != h.flagged or not h.convinced:
            return False
        for q in h.additive:
            k = self.at.fault[q]
            if h.z[k] ** 2 > min(h.P[k, k], self.tuning["displaced"] * self.reading.noise[q] ** 2):
                return False
        return True

    def _try(self, change: Callable[[Hypothesis], None]) -> Trial:
        child = self.h.copy()
        change(child)
        return Trial(child, self.bank._predict(child, self.reading))  # noqa: SLF001

    def _add(
        self, name: str, log_rate: float, change: Callable[[Hypothesis], None], *, convinced: bool, misfit: float = 0.0
    ) -> None:
        """Adds a candidate; the bias or wrong gain that it finds counts only where this one sample speaks for it."""
        trial = self._try(change)
        score = self.h.score + log_rate + trial.seen.likelihood
        by_residual = name in ("bias", "scale") and not self.bank.trusts_model
        convinced = convinced and (not by_residual or score > self.stay)
        child = trial.child
        candidate = Candidate(
            name, score, self.index, convinced, child.kinds, child.plant_changed, misfit, lambda: child
        )
        self.list.append(candidate)

    # The plant.

    def _plant_changes(self) -> None:
        h, bank, tuning = self.h, self.bank, self.tuning
        if self.unlikely:
            for jump in self.plant.jumps(self.log_rate["load"], tuning):
                self._add("load", jump.log_rate, self._jumped(jump), convinced=h.convinced)
            if not h.plant_changed:
                log_rate = tuning["everything"] * self.log_rate["load"]
                self._add("changed", log_rate, self._plant_changed, convinced=h.convinced)
        if h.plant_changed:
            restored = Candidate(
                "restored", self.stay + self.log_rate["release"], self.index, h.convinced, h.kinds, plant_changed=False
            )
            restored.make = self._plant_restored
            self.list.append(restored)
        if bank.first:
            if not h.flagged:
                log_rate = self.log_rate["fault"]
                self._add("start", log_rate, self._started, convinced=h.convinced, misfit=-2.0 * log_rate)
            return
        for name, run in (("home", bank.unloaded), ("return", bank.usual)):
            if self.unlikely and run.displaced(self.seen.output, tuning["returned"]):
                # What stands against the loads that would then be gone makes up for the log_rate of a fault.
                off = (h.z[self.at.load] - run.loads)[self.plant.load_size > 0.0]
                against = 0.5 * np.sum((off / self.plant.load_size[self.plant.load_size > 0.0]) ** 2)
                log_rate = min(self.log_rate["fault"] + against, 0.0)
                score = h.score + log_rate + self._run_seen(run, NOBODY).likelihood
                self._put_back(name, run, NOBODY, score=score, convinced=h.convinced)
        if not h.flagged:
            self._drifted()

    def _plant_restored(self) -> Hypothesis:
        child = self.h.copy()
        child.plant_changed = False
        return child

    def _jumped(self, jump: Jump) -> Callable[[Hypothesis], None]:
        def change(child: Hypothesis) -> None:
            child.P = child.P + self.plant.jump(jump, self.bank.u, self.bank.settings["gain_error"])

        return change

    def _plant_changed(self, child: Hypothesis) -> None:
        """The matrices may be wrong in any way: so may what they did to the last sample."""
        at, plant = self.at, self.plant
        error = self.bank.settings["changed_error"] ** 2
        off, moved = child.before - plant.x0, self.bank.u - plant.u0
        missed = error * (plant.A**2 @ off**2 + plant.B**2 @ moved**2)
        on_states = at.load[at.m + at.s :]
        for rows in (at.x, on_states):
            for columns in (at.x, on_states):
                child.P[rows, columns] += missed
        child.plant_changed = True

    def _started(self, child: Hypothesis) -> None:
        child.P[self.at.x, self.at.x] += np.square(self.bank.settings["start_elsewhere"])

    def _run_seen(self, run: ModelRun, drifted: frozenset[int]) -> Seen:
        """What the sample says if no load acts and these sensors have drifted."""
        valid = self.reading.valid
        opened = np.array([self._opened(q, drifted) for q in range(self.at.p)])
        own = np.where(valid, self.reading.noise**2 + opened, 1.0)
        S = run.covariance * np.outer(valid, valid) + np.diag(own)
        return Seen(np.where(valid, self.reading.y - run.y, 0.0), S, run.y)

    def _put_back(self, name: str, run: ModelRun, drifted: frozenset[int], *, score: float, convinced: bool) -> None:
        candidate = Candidate(name, score, self.index, convinced, (drifted, NOBODY, NOBODY), self.h.plant_changed)
        candidate.misfit_penalty = -2.0 * self.log_rate["fault"]
        candidate.make = lambda: self._at_run(run, drifted)
        self.list.append(candidate)

    def _opened(self, q: int, drifted: frozenset[int]) -> float:
        return self.fault_size[q] ** 2 if q in drifted else self._healthy_variance(q)

    def _at_run(self, run: ModelRun, drifted: frozenset[int]) -> Hypothesis:
        """Returns the hypothesis put back to a run of the model: its state, its loads, no other faults."""
        child, at = self.h.copy(), self.at
        child.additive, child.stuck, child.scaled = drifted, NOBODY, NOBODY
        for k, mean, variance in zip(at.x, run.x, run.variances(self.plant), strict=True):
            child.open(k, mean, variance)
        child.before = run.x.copy()
        left = self.tuning["load_remainder"]
        for k, mean, size in zip(at.load, run.loads, self.plant.load_size, strict=True):
            child.open(k, mean, left * size**2)
        for k, mean in zip(at.gain, run.gains, strict=True):
            child.open(k, mean, left * self.bank.settings["gain_error"] ** 2)
        for q, k in enumerate(at.fault):
            child.open(k, 0.0, self._opened(q, drifted))
        return child

    def _drifted(self) -> None:
        """The sensors that have left the model in open loop may have drifted, and no load acts."""
        bank = self.bank
        limit = self.tuning["displaced" if bank.trusts_model else "returned"]
        drifted = bank.unloaded.displaced(self.seen.output, limit) & self.valid
        known = any(other.additive == drifted and not other.convinced for other in bank.hypotheses)
        if not drifted or (not bank.trusts_model and known):
            return
        seen = self._run_seen(bank.unloaded, drifted)
        if seen.square >= self.tuning["quiet_beside"] + self.tuning["quiet_per_output"] * self.at.p:
            return
        score = self.stay
        if bank.trusts_model:
            score = max(score, self.h.score + seen.likelihood) + 1.0
        self._put_back("drift", bank.unloaded, drifted, score=score, convinced=bank.trusts_model)

    # The sensors.

    def _healthy_variance(self, q: int) -> float:
        return float(self.plant.output_variance[q]) if self.bank.outputs_may_err else 0.0

    def _biased(self, sensors: frozenset[int]) -> Callable[[Hypothesis], None]:
        """A bias begins or jumps: from what it was, or from nothing."""

        def change(child: Hypothesis) -> None:
            for q in sensors:
                k = self.at.fault[q]
                goes_on = q in self.h.additive or (self.bank.outputs_may_err and q not in self.h.flagged)
                if goes_on:
                    child.P[k, k] += self.fault_size[q] ** 2
                else:
                    child.open(k, 0.0, self.fault_size[q] ** 2)
            child.additive |= sensors
            child.stuck -= sensors
            child.scaled -= sensors

        return change

    def _rescaled(self, q: int) -> Callable[[Hypothesis], None]:
        def change(child: Hypothesis) -> None:
            child.open(self.at.fault[q], self.tuning["gain_fault_mean"], self.tuning["gain_fault_variance"])
            child.additive -= {q}
            child.scaled |= {q}

        return change

    def _frozen(self, q: int) -> Callable[[Hypothesis], None]:
        """Freezes a sensor: where its reading repeats exactly, nothing is kept of what it repeated."""
        repeats, earlier = self.bank.repeats, self.bank.before_it_froze(q)

        def change(child: Hypothesis) -> None:
            if earlier:
                child.z, child.P, child.before = earlier.z.copy(), earlier.P.copy(), earlier.before.copy()
                child.misfit, child.moved_by = earlier.misfit, earlier.moved_by
            variance = self.reading.noise[q] ** 2 / max(repeats.count[q], 1.0)
            child.open(self.at.fault[q], repeats.mean[q], variance)
            child.additive -= {q}
            child.scaled -= {q}
            child.stuck |= {q}

        return change

    def _released(self, sensors: frozenset[int]) -> Callable[[Hypothesis], None]:
        def change(child: Hypothesis) -> None:
            for q in sensors:
                child.open(self.at.fault[q], 0.0, self._healthy_variance(q))
            child.additive -= sensors
            child.stuck -= sensors
            child.scaled -= sensors

        return change

    def _together(self, sensors: int) -> float:
        """Log probability that so many sensors fail, or recover, at once over that of one."""
        return 1.0 + (self.tuning["several"] - 1.0) * (sensors - 1)

    def _faults_begin(self) -> None:
        """Of one sensor, of two where there are few, of all."""
        if not self.unlikely:
            return
        free = sorted(self.valid - self.h.flagged)
        log_rate = self.tuning["start_fault"] if self.bank.first else self.log_rate["fault"]
        kept = {"convinced": self.h.convinced, "misfit": -2.0 * self.log_rate["fault"]}
        pair = self._together(2) * log_rate
        for q in free:
            self._add("bias", log_rate, self._biased(frozenset({q})), **kept)
            self._add("scale", log_rate, self._rescaled(q), **kept)
            if 2 < self.at.p <= 4:
                for other in (other for other in free if other < q):
                    self._add("bias", pair, self._biased(frozenset({q, other})), **kept)
        if len(free) > 1:
            self._add("bias", self._together(len(free)) * log_rate, self._biased(frozenset(free)), **kept)

    def _faults_change_or_end(self) -> None:
        h, bank = self.h, self.bank
        known = h.flagged & self.valid
        for q in range(self.at.p):
            may_freeze = q in self.valid and q not in h.stuck and h is bank.hypotheses[0]
            if may_freeze and bank.repeats.evidence[q] > self.tuning["frozen_evidence"]:
                log_rate = self.log_rate["stuck"] + bank.repeats.before[q]
                begins = -2.0 * self.log_rate["fault"]
                self._add("freeze", log_rate, self._frozen(q), convinced=h.convinced, misfit=begins)
            if q not in known:
                continue
            if self.unlikely:
                log_rate = self.log_rate["change"]
                again = -2.0 * log_rate
                self._add("change", log_rate, self._biased(frozenset({q})), convinced=h.convinced, misfit=again)
            log_rate = 0.0 if q in self.resumed else self.log_rate["release"]
            self._release(frozenset({q}), log_rate, convinced=h.convinced or len(h.flagged) == 1)
        if len(known) > 1:
            self._release(h.flagged, self._together(len(h.flagged)) * self.log_rate["release"], convinced=True)

    def _release(self, sensors: frozenset[int], log_rate: float, *, convinced: bool) -> None:
        """The recovery of these sensors, unless what it leaves is there already."""
        trial = self._try(self._released(sensors))
        score = self.h.score + log_rate + trial.seen.likelihood
        left = self.h.flagged - sensors
        for other in self.bank.hypotheses:
            seen = self.bank.seen[id(other)]
            if (
                other is not self.h
                and (other.flagged, other.additive, other.convinced) == (left, left, True)
                and (other.plant_changed, other.mode) == (self.h.plant_changed, self.h.mode)
                and other.score + seen.likelihood >= score
                and seen.leaves(trial.seen.r, self.tuning["same_estimate"])
            ):
                return
        child = trial.child
        self.list.append(
            Candidate("release", score, self.index, convinced, child.kinds, child.plant_changed, 0.0, lambda: child)
        )
