"""A hum, a line over the time, in a torque that a model takes as an input: smoothing has taken part of it away."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rig.loop.model.terms import Entry, Line
from rig.loop.signals.tracks import Track

Floats = NDArray[np.float64]


def with_hums(track: Track, lines: Sequence[Line]) -> Track:
    """Give a track back what smoothing took of the hums among `lines`.

    A hum is subtracted from the torques of the track as it was recorded, while the polyline of a swept torque holds
    nothing of it and a mean a part. How much is lost is fitted to what smoothing took.
    """
    motor, output = (
        [line.order for line in lines if line.kind.variable == "time" and line.kind.entry is entry]
        for entry in (Entry.MOTOR, Entry.OUTPUT)
    )
    if not motor and not output:
        return track
    return replace(
        track,
        M=_with_lost(track, track.M, track.motor_torque, motor),
        play_drive=_with_lost(track, track.play_drive, track.motor_torque, motor),
        T=_with_lost(track, track.T, track.output_torque, output),
        play_load=_with_lost(track, track.play_load, track.output_torque, output),
    )


def _with_lost(
    track: Track, smoothed: Floats | None, recorded: Floats | None, frequencies: Sequence[float]
) -> Floats | None:
    """Add to a `smoothed` torque (n * fine,) the sines (Hz) that it lost of what was `recorded` (n,), N*m."""
    if smoothed is None or recorded is None or not frequencies or not track.usable.any():
        return smoothed
    fine = smoothed.size // track.size
    offsets = track.period * ((np.arange(fine) + 0.5) / fine - 0.5)
    angles = 2.0 * np.pi * np.outer((track.time[:, None] + offsets).ravel(), frequencies)
    sines = np.hstack([np.sin(angles), np.cos(angles)])
    means = sines.reshape(track.size, fine, -1).mean(axis=1)
    lost = recorded - smoothed.reshape(track.size, fine).mean(axis=1)
    amplitudes = np.linalg.lstsq(means[track.usable], lost[track.usable], rcond=None)[0]
    return np.asarray(smoothed + sines @ amplitudes)
