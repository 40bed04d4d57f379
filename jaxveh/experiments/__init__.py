"""One folder per paper: settings, run, and check against the printed numbers."""

from jaxveh._core.lazy import submodules

__all__ = ["federated_ckf", "mass_grade_aukf", "model_adaptive_pf", "report", "sideslip_review", "tyre_apf"]

__getattr__ = submodules(__name__, __all__)
