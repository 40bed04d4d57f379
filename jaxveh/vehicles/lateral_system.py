"""The linear lateral dynamics of a car at one speed, with closed-form characteristics."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import lax

from jaxveh import numerics


class LateralResponse(NamedTuple):
    """The complex amplitudes of `sideslip` (-), `yaw_rate` (1/s) and `a_y` (m/s^2 per rad) over that of the steer."""

    sideslip: Any
    yaw_rate: Any
    a_y: Any


class LateralSystem(NamedTuple):
    """d/dt (sideslip, yaw_rate) = A (sideslip, yaw_rate) + B steer, at the speed `speed` (m/s).

    `a_11` (1/s), `a_12` (-), `a_21` (1/s^2), `a_22` (1/s) are the entries of A, `b_1` (1/s) and `b_2` (1/s^2) those of B;
    scalars, or arrays of one shape. The characteristics are those of a second-order system (M. Mitschke & H. Wallentowitz,
    Dynamik der Kraftfahrzeuge, the chapter on the linear single-track model).
    """

    a_11: Any
    a_12: Any
    a_21: Any
    a_22: Any
    b_1: Any
    b_2: Any
    speed: Any

    @property
    def trace(self) -> Any:
        """The sum of the eigenvalues, 1/s."""
        return self.a_11 + self.a_22

    @property
    def determinant(self) -> Any:
        """The product of the eigenvalues, 1/s^2; negative above the critical speed."""
        return self.a_11 * self.a_22 - self.a_12 * self.a_21

    @property
    def eigenvalues(self) -> tuple[Any, Any]:
        """The eigenvalues tr / 2 +- sqrt(tr^2 / 4 - det), 1/s, as complex numbers; the second one is the more stable real one or
        the one with negative imaginary part."""
        half = 0.5 * self.trace
        inside = half * half - self.determinant
        real = numerics.sqrt(jnp.maximum(inside, 0.0))
        imaginary = numerics.sqrt(jnp.maximum(-inside, 0.0))
        return lax.complex(half + real, imaginary), lax.complex(half - real, -imaginary)

    @property
    def natural_frequency(self) -> Any:
        """The undamped natural frequency sqrt(det), rad/s; nan if the car is unstable (det <= 0)."""
        return jnp.where(self.determinant > 0, numerics.sqrt(jnp.maximum(self.determinant, 0.0)), jnp.nan)

    @property
    def damping_ratio(self) -> Any:
        """The damping ratio -tr / (2 sqrt(det)), 1 or more without oscillation; nan if the car is unstable (det <= 0)."""
        held = self.determinant > 0
        return jnp.where(held, -0.5 * self.trace / numerics.sqrt(numerics.or_one(self.determinant, held)), jnp.nan)

    def frequency_response(self, omega: Any) -> LateralResponse:
        """The transfer functions over the steer at s = i `omega` (rad/s):

        sideslip = (b_1 s + a_12 b_2 - a_22 b_1) / D,    yaw_rate = (b_2 s + a_21 b_1 - a_11 b_2) / D,
        a_y = speed (s sideslip + yaw_rate),    D = s^2 - tr s + det
        """
        zero = jnp.zeros_like(omega)
        bottom = lax.complex(self.determinant - omega * omega, -self.trace * omega)
        sideslip = lax.complex(self.a_12 * self.b_2 - self.a_22 * self.b_1 + zero, self.b_1 * omega) / bottom
        yaw_rate = lax.complex(self.a_21 * self.b_1 - self.a_11 * self.b_2 + zero, self.b_2 * omega) / bottom
        speed = lax.complex(self.speed + zero, zero)
        return LateralResponse(sideslip, yaw_rate, speed * (lax.complex(zero, omega) * sideslip + yaw_rate))
