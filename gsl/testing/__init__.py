"""Contract tests for components of one's own: what gsl relies on, each broken promise as one line.

    from gsl.testing import check_effect
    from cold_grease import ColdGrease

    def test_cold_grease() -> None:
        check_effect(ColdGrease(thickness=0.5))

A check returns nothing, or raises an AssertionError. Our own components pass the same checks.
"""

from gsl.testing.components import check_component
from gsl.testing.effects import check_effect
from gsl.testing.groundings import check_grounding
from gsl.testing.policies import check_policy
from gsl.testing.searches import check_search
from gsl.testing.tasks import check_task

__all__ = ["check_component", "check_effect", "check_grounding", "check_policy", "check_search", "check_task"]
