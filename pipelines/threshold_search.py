# SPDX-License-Identifier: LGPL-2.1-or-later
"""Finds the contrast thresholds at which a simulator generates as many events as a recording has."""
from dataclasses import dataclass, field

import numpy as np
from event_streams import Gst, counts

# Relative precision of event counts; ROUGH_PRECISION suffices for rating other properties. If no thresholds
# reach it, because frames have whole grey levels, the search restarts at most MAX_ROUNDS times.
PRECISION = 1e-3
ROUGH_PRECISION = 1e-2
MAX_ROUNDS = 3
MAX_TRIALS = 60
# First guess of the slope of event counts over thresholds, in a log-log plot.
USUAL_SLOPE = -1.5


@dataclass
class Setting:
    """An element with its properties, without thresholds; `shares` are properties relative to their mean."""

    element: str
    shares: dict = field(default_factory=dict)

    def __str__(self):
        return " ".join([self.element] + [f"{name}={share:g}*threshold" for name, share in self.shares.items()])

    def with_thresholds(self, thresholds):
        values = {name: share * np.mean(thresholds) for name, share in self.shares.items()}
        values |= {"positive-threshold": thresholds[0], "negative-threshold": thresholds[1]}
        return " ".join([self.element] + [f"{name}={value:.6g}" for name, value in values.items()])


def threshold_limits(element):
    """The minimum, maximum and default of an element's thresholds."""
    made = Gst.ElementFactory.make(element.split()[0])
    if made is None:
        raise RuntimeError(f"there is no element \"{element.split()[0]}\"; name a simulator, such as eventsim-dvs")
    spec = made.find_property("positive-threshold")
    if spec is None:
        raise RuntimeError(f"\"{element}\" has no thresholds; name a simulator, such as eventsim-dvs")
    return spec.minimum, spec.maximum, spec.default_value


class ThresholdSearch:
    """Finds the thresholds at which a simulator generates the numbers `goal` of ON and OFF events, starting from
    `first`: by secant steps in a log-log plot while they at least halve the error, otherwise by bisection."""

    def __init__(self, goal, limits, first, precision):
        minimum, self.maximum, default = limits
        self.minimum = max(minimum, default / 100)
        self.goal, self.precision = goal, precision
        self.low, self.high = np.full(2, self.minimum), np.full(2, min(self.maximum, default * 20))
        self.next = np.sqrt(self.low * self.high) if first is None else first
        self.trusts_slope = first is not None  # USUAL_SLOPE is good after the first trial
        # The best threshold of each polarity need not be the best pair: an event of one polarity also resets the
        # reference level for the other.
        self.each, self.each_error = np.full(2, default), np.full(2, np.inf)
        self.best, self.best_error = np.full(2, default), np.full(2, np.inf)
        self.before = None  # thresholds and log ratios of the last trial
        self.rounds = 0

    def is_closed(self):
        """True if the bounds leave only the best threshold of each polarity to try."""
        return (self.high / self.low < 1 + self.precision).all()

    def pair(self):
        """The thresholds to try next."""
        return self.each.copy() if self.is_closed() else self.next

    def add(self, made):
        """Adds the numbers of events at these thresholds. Returns True if the search ends."""
        thresholds, closed = self.pair(), self.is_closed()
        log_ratio = np.log(np.maximum(made, 0.5) / self.goal)
        self._keep(thresholds, np.abs(log_ratio))
        if np.abs(log_ratio).max() < self.precision:
            return True
        if closed:
            self.rounds += 1
            if self.best_error.max() < 0.01 or self.rounds == MAX_ROUNDS:
                return True
            self._restart()
        else:
            more = made > self.goal
            self.low, self.high = np.where(more, thresholds, self.low), np.where(more, self.high, thresholds)
        self._step(thresholds, log_ratio)
        return False

    def _keep(self, thresholds, error):
        self.each = np.where(error < self.each_error, thresholds, self.each)
        self.each_error = np.minimum(error, self.each_error)
        if error.sum() < self.best_error.sum():
            self.best, self.best_error = thresholds, error

    def _restart(self):
        """Restarts around the best pair."""
        self.low, self.high = np.maximum(self.best / 1.3, self.minimum), np.minimum(self.best * 1.3, self.maximum)
        self.each, self.each_error = self.best, self.best_error
        self.before = None

    def _step(self, thresholds, log_ratio):
        slope, converging = np.full(2, USUAL_SLOPE), np.full(2, self.trusts_slope)
        self.trusts_slope = False
        if self.before is not None:
            before, log_before = self.before
            with np.errstate(divide="ignore", invalid="ignore"):
                slope = (log_ratio - log_before) / np.log(thresholds / before)
            converging = (np.abs(log_ratio) < np.abs(log_before) / 2) & (slope > -6) & (slope < -0.3)
            slope = np.where(converging, slope, USUAL_SLOPE)
        self.before = thresholds, log_ratio
        step = thresholds * np.exp(-log_ratio / slope)
        within = converging & (step > self.low) & (step < self.high)
        self.next = np.where(within, step, np.sqrt(self.low * self.high))


def find_thresholds(simulated_by, recorded, span, setting, progress, first=None, precision=PRECISION, share=1.0):
    """The thresholds at which the simulator generates this share of the recorded ON and OFF events within the
    span."""
    goal = share * counts(span.of(recorded))
    if goal.min() == 0:
        raise RuntimeError("the recording lacks ON or OFF events in the time to calibrate on; choose another with"
                           " --from and --to")
    search = ThresholdSearch(goal, threshold_limits(setting.element), first, precision)
    for trial in range(MAX_TRIALS):
        thresholds = search.pair()
        simulated = simulated_by(setting.with_thresholds(thresholds))
        made = counts(span.of(simulated))
        progress.update(f"{setting}: trial {trial + 1}, thresholds {thresholds[0]:.4g} and"
                      f" {thresholds[1]:.4g}, {made[0] / goal[0]:.3f} of the ON and"
                      f" {made[1] / goal[1]:.3f} of the OFF events")
        if search.add(made):
            break
    return search.best
