"""States, friction and parameters of a four-motor car by three federated cubature Kalman filters, and by better ones."""

from jaxveh.experiments.federated_ckf.criteria import CRITERIA
from jaxveh.experiments.federated_ckf.printed_tables import as_printed
from jaxveh.experiments.federated_ckf.report import Reproduction, check, run, settings, tables
from jaxveh.experiments.federated_ckf.settings import CITATION, Study

__all__ = ["CITATION", "CRITERIA", "Reproduction", "Study", "as_printed", "check", "run", "settings", "tables"]
