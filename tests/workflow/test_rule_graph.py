"""The pictures of the rules are those of the rules."""

from tests.workflow import dry_runs
from tests.workflow.project import ROOT
from tools import rule_graph


def test_the_page_shows_the_rules_as_they_are():
    runs = ((ROOT, rule_graph.arguments(config)) for config in rule_graph.STUDIES.values())
    told = dict(zip(rule_graph.STUDIES, dry_runs.many(runs), strict=True))
    assert rule_graph.PAGE.read_text() == rule_graph.page(told), "run `make docs`"


def test_an_arrow_that_others_lead_along_is_left_out():
    assert rule_graph.without_shortcuts(
        {("scan", "clean"), ("clean", "light"), ("scan", "light")}
    ) == {
        ("scan", "clean"),
        ("clean", "light"),
    }
