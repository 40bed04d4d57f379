"""`sideslip.live` as a method: integration corrected by the rear axle's force, with standard deviations that include the
uncertainty of the car's file."""

from __future__ import annotations

from typing import ClassVar

from jaxveh.estimators.cleaning import BLIND, RearAxleCleaning
from jaxveh.estimators.live import Live, live_init, live_step
from jaxveh.estimators.method import AbstractMethod, answer
from jaxveh.estimators.parameter_bands import members_of_prior
from jaxveh.estimators.prepared import Chained
from jaxveh.estimators.rear_axle import rear_axle_model
from jaxveh.estimators.rear_axle_prior import SPREADS, car_of, chosen_parameters, unfitted_spreads
from jaxveh.estimators.sideslip_methods.common import A_Y, YAW_RATE, Guarded, guard
from jaxveh.filters import Extended
from jaxveh.io import CarSpecification


class AsLive(AbstractMethod):
    """A live estimator as a method: its row is a time and the channels that its cleaning reads. The standard deviations are those
    of its bands."""

    live: Live

    knows_places: ClassVar[bool] = True

    @property
    def needs(self):
        steered = self.live.model.system.rear_steer
        return BLIND if steered is None else BLIND + steered.more

    def first(self, t, values):
        return self._said(live_init(self.live, (t, self._of_its_own(values))))

    def next(self, memory, t, values):
        return self._said(live_step(self.live, memory, (t, self._of_its_own(values))))

    def _of_its_own(self, values):
        return {name: values[name] for name in self.live.cleaning.channels}

    def _said(self, found):
        memory, told = found
        said = answer(told.mean._asdict(), told.std._asdict(), told.info.result == 0)
        return memory, said._replace(result=told.info.result)


def rear_axle(car: CarSpecification) -> Guarded:
    """Makes `rear_axle.RearAxle` from a car's file, as `sideslip.live` uses it without a calibration; its rear wheels may be
    steered."""
    system = car_of(car)
    model = rear_axle_model(system)
    steered, cleaning = system.rear_steer, RearAxleCleaning(car.wheelbase, system.rear_steer is not None)
    cleaning = cleaning if steered is None else Chained(steered, cleaning)
    members = members_of_prior(model, chosen_parameters, SPREADS, unfitted_spreads(system))
    return guard(car, AsLive(Live(Extended(), model, cleaning, None, members)), (YAW_RATE, A_Y))
