"""Models that are learned from drives: a tyre law inside a filter, trained by the filter's likelihood; a sideslip network."""

from jaxveh.estimators.learned.residual_tyre import ResidualTyre, network_weights, with_residual_tyres
from jaxveh.estimators.learned.training import Trained, train
from jaxveh.estimators.sideslip_methods.network import SideslipNetwork, sideslip_network

__all__ = [
    "ResidualTyre",
    "SideslipNetwork",
    "Trained",
    "network_weights",
    "sideslip_network",
    "train",
    "with_residual_tyres",
]
