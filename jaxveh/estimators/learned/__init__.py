"""What is learned from drives: a tyre's law inside a filter, trained through the filter's likelihood."""

from jaxveh.estimators.learned.residual_tyre import ResidualTyre, network_weights, with_residual_tyres
from jaxveh.estimators.learned.training import Trained, train

__all__ = ["ResidualTyre", "Trained", "network_weights", "train", "with_residual_tyres"]
