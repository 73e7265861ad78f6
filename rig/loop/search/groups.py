"""What these data may not tell apart: groups of causes, and what it takes to see a difference."""

from collections.abc import Mapping

SET_SHARE = 0.9
"""Share of the pick's gain from which on another class joins the set."""

QUOTIENT = ("torque-constant-error", "torque-sensor-gain")
"""What base parameters take up, each its own: only that the two torques do not agree shows, never which is wrong."""

LEAST_SLOPE = 3e-4
"""Relative deviation of the two torques' ratio that is worth a statement."""

NESTED: Mapping[str, tuple[str, ...]] = {"rate-dependent-hysteresis": ("creep", "maxwell-slip")}
"""A class that holds others as special cases: it is taken only if it explains more."""

LEAST_START_ANGLES = 4
"""Start angles without which a locked sweep cannot tell an angle error from a torque-shaped one."""

TWINS: dict[str, str] = {
    "kinematic-error": "motor-encoder-eccentricity",
    "motor-encoder-eccentricity": "kinematic-error",
}
"""What looks the same at order 1 until the encoder is re-clocked."""

SINGLE_ANGLE_SET = ("flexspline-compliance", "kinematic-error", "soft-windup", "stiffness-modulation")
"""What one start angle cannot tell apart (quotient group of the effect catalogue)."""
