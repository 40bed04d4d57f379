"""jaxveh: estimate what a car cannot measure, in JAX, differentiable end to end."""

from jaxveh._core.errors import FilterError, InputError, JaxvehWarning
from jaxveh._core.recording import Recording
from jaxveh._core.result import Result

__version__ = "0.1.0"

__all__ = ["FilterError", "InputError", "JaxvehWarning", "Recording", "Result", "__version__"]
