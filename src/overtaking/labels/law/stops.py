"""Whether the ego could stop in the distance that it saw, over all of its conduct."""

from overtaking.labels.law.engine import stop_margin
from overtaking.labels.law.frames import Stretch, conduct
from overtaking.model.labels import Case
from overtaking.model.once import once


@once
def stop_for_lit(case: Case) -> Stretch:
    """Distance at which a lit vehicle is seen minus the stopping distance [m]."""
    return stop_margin(case, case.signals.sight_lit, conduct(case))


@once
def stop_for_unlit(case: Case) -> Stretch:
    """The same for an unlit obstacle [m]."""
    return stop_margin(case, case.signals.sight_unlit, conduct(case))
