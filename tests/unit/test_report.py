"""The report: what it says first, that input is never taken for HTML, what columns mean."""

import json
import re

import numpy as np
import pandas as pd
import pytest
import yaml

from dapple import findings
from dapple.report import blocks, methods, numbers, run_report
from dapple.report.blocks import Section, Text, number, table
from dapple.report.document import document
from dapple.report.quantities import quantity
from dapple.report.recommendation import sentences
from dapple.report.references import REFERENCES
from dapple.verdict.signal_meanings import SIGNALS

EVIL = "<script>alert(1)</script>"


def judged(**states):
    """A verdict on reconstructions, each with one reason."""
    loss = {"green": 0.1, "amber": 0.5, "red": 0.9}
    reason = {
        "signal": "sparse_polygons",
        "value": 0.66,
        "usual": 0.27,
        "text": "66% of the polygons are made of one or two points",
        "usual_text": "27% of the polygons are made of one or two points",
        "help": SIGNALS["sparse_polygons"].help,
        "share": 1.0,
        "is_beyond": False,
    }
    facts = {
        name: {"state": state, "expected_loss": loss[state], "alarm": 0.4, "reasons": [reason]}
        for name, state in states.items()
    }
    best = min(states.values(), key=list(loss).index)
    return {"state": best, "reconstructions": facts, "with_records": True, "unknown": []}


def overall(**rmse):
    rows = [
        {"reconstruction": name, "n": 90, "r": 0.9, "r_low": 0.8, "r_high": 0.95, "rmse": one,
         "bias": -20.0, "mae": 50.0, "baseline_r": 0.3}
        for name, one in rmse.items()
    ]  # fmt: skip
    return pd.DataFrame(rows)


def written(folder, files, captions=()):
    """The page of a folder with these files."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, pd.DataFrame):
            content.to_csv(path, index=False)
        else:
            path.write_text(json.dumps(content))
    return run_report.build("some run", folder, dict(captions))


# What stands first


def test_the_first_sentence_says_which_reconstruction_to_use_and_the_next_which_not():
    said = sentences(judged(polygons="amber", voxels_1="red", surfels="green"), None)
    assert said[0].startswith("Use surfels")
    assert said[1].startswith("Polygons are doubtful: 66")
    assert "undisturbed: 27" in said[1]
    assert said[2].startswith("Do not use voxels of 1 m: ")


def test_the_best_of_several_sound_ones_is_named_and_the_others_too():
    verdict = judged(polygons="green", surfels="green")
    verdict["reconstructions"]["surfels"]["expected_loss"] = 0.05
    assert sentences(verdict, None)[0].startswith("Use surfels")
    assert sentences(verdict, None)[1].startswith("Polygons can be used as well")


def test_nothing_is_recommended_where_all_are_red():
    said = sentences(judged(polygons="red", voxels_1="red"), None)
    assert said[0] == "Do not use the light of this run as it is."


def test_where_none_is_beyond_doubt_the_least_doubtful_is_used_with_care():
    assert sentences(judged(polygons="red", surfels="amber"), None)[0].startswith(
        "Use surfels with care"
    )


def test_what_is_not_known_is_the_reason_where_no_signal_raised_the_alarm():
    verdict = judged(polygons="amber")
    verdict["reconstructions"]["polygons"]["expected_loss"] = 0.1
    verdict["unknown"] = [{"lacks": "shots", "text": "nobody knows", "help": "Export pulses."}]
    assert "Polygons are doubtful: nobody knows." in sentences(verdict, None)


def test_a_small_loss_that_is_doubted_says_what_is_not_known(tmp_path):
    verdict = judged(polygons="amber", surfels="amber")
    verdict["reconstructions"]["polygons"]["expected_loss"] = 0.1
    verdict["unknown"] = [{"lacks": "shots", "text": "nobody knows", "help": "Export pulses."}]
    page = written(tmp_path, {"verdict.json": verdict})
    assert page.count("Doubted for what is not known: nobody knows.") == 1


def test_commands_are_set_as_such_and_stay_escaped():
    page = document("t", [], [Section("s", [Text([f"Type `make run` or {EVIL} or `{EVIL}`."])])])
    assert "<code>make run</code>" in page
    assert EVIL not in page
    assert "`" not in page.split("</header>")[-1].split("<script")[0]


def test_records_choose_among_what_may_be_used_and_the_scan_says_what_it_has_against_it():
    verdict = judged(polygons="amber", voxels_1="green", surfels="red")
    first, *others = sentences(verdict, overall(truth=1, surfels=50, polygons=100, voxels_1=300))
    assert first.startswith("Use polygons: of all, their light comes nearest to 90 records (r = ")
    assert "RMSE 100, bias −20" in first
    assert "Away from these sensors take care: 66" in first
    assert others[0].startswith("Voxels of 1 m can be used as well")
    assert others[1].startswith("Do not use surfels")
    assert len(others) == 2


def test_what_is_best_by_records_and_was_not_judged_is_said_to_be_so():
    first = sentences(judged(voxels_1="green"), overall(surfels=100.0, voxels_1=200.0))[0]
    assert first.startswith("Use surfels")
    assert "not known yet" in first
    first = sentences(judged(voxels_1="green"), overall(voxels_1=200.0))[0]
    assert first.endswith("and nothing in the scan speaks against them.")


def test_the_page_opens_with_the_sentence_and_never_calls_a_run_sound_while_one_is_red(tmp_path):
    page = written(tmp_path, {"verdict.json": judged(polygons="red", surfels="green")})
    assert page.index("Use surfels") < page.index("<h2>")
    assert page.index("Do not use polygons") < page.index("<h2>")
    assert SIGNALS["sparse_polygons"].help in page
    assert "How far to trust it" not in written(tmp_path / "bare", {})


# Input


def test_what_comes_from_input_is_text_and_never_html(tmp_path):
    table = overall(polygons=1.0).assign(reconstruction=EVIL)
    note = findings.note(EVIL, EVIL)
    page = written(
        tmp_path,
        {
            "statistics/overall.csv": table,
            "sky/radiation.json": {"findings": findings.rows([note])},
        },
    )
    assert "<script>alert" not in page
    assert page.count("&lt;script&gt;alert") >= 2
    page = document(EVIL, [EVIL], [Section(EVIL, [Text([EVIL])])])
    assert "<script>alert" not in page


def test_the_page_tells_what_was_noticed_about_the_input_the_worst_first(tmp_path):
    noticed = [findings.note("a.csv", "3 rows twice"), findings.warning("a.csv", "a <gap>")]
    facts = {"modelled_share_of_day": 0.25, "findings": findings.rows(noticed)}
    page = written(tmp_path, {"sky/radiation.json": facts})
    assert page.index("a &lt;gap&gt;") < page.index("3 rows twice")
    assert "at 25 % of the times with the sun up" in page
    assert "noticed" not in written(tmp_path / "empty", {})


# Tables and figures


def test_the_page_shows_the_figures_that_there_are_with_their_captions(tmp_path):
    (tmp_path / "tree.png").write_bytes(b"a picture")
    page = written(tmp_path, {}, {"tree.png": "A <tree>.", "gap.png": "A gap."})
    assert "<figcaption>A &lt;tree&gt;.</figcaption>" in page
    assert "A gap" not in page


def test_columns_have_units_and_meanings_and_cells_the_number_they_are_sorted_by(tmp_path):
    page = written(tmp_path, {"statistics/overall.csv": overall(polygons=1234.5678)})
    assert re.search(r'RMSE</abbr> <span class="unit">µmol m⁻² s⁻¹', page)
    assert "Mean of simulated minus measured." in page
    assert 'data-key="1234.5678">1\u202f235</td>' in page


def test_a_page_without_charts_carries_no_library_of_charts():
    assert len(document("x", [], [])) < 40_000


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"), (0.98765, "0.988"), (-0.0123456, "−0.0123"), (123456.7, "123\u202f457"),
        (99.96, "100"), (1e-9, "< 0.0001"), (-7.16e-5, "> −0.0001"),
    ],
)  # fmt: skip
def test_numbers_have_three_digits_that_count(value, text):
    assert number(value) == text


def test_whole_numbers_are_counts_and_units_are_read_from_names():
    shown = table(pd.DataFrame({"n": [36, 3600], "reach_m": [0.5, 1.0]}), "x")
    assert [row[0].text for row in shown.rows] == ["36", "3\u202f600"]
    assert [row[1].text for row in shown.rows] == ["0.500", "1.00"]
    assert (shown.columns[1].label, shown.columns[1].unit) == ("reach", "m")


def test_what_is_missing_is_a_dash_and_sorted_below_all_numbers():
    shown = table(pd.DataFrame({"r": [0.5, float("nan")]}), "x")
    assert [row[0].text for row in shown.rows] == ["0.500", "–"]
    assert shown.rows[1][0].key < shown.rows[0][0].key


def test_the_methods_cite_what_the_configuration_used_and_no_more(tmp_path):
    settings = {
        "study": "light",
        "source": "cloud",
        "reconstructions": ["polygons"],
        "radiation": {"kind": "table", "sky": "isotropic"},
        "light": {"engine": "less"},
    }
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(settings))
    text, cited, bibtex = methods.blocks(tmp_path)
    assert "polygon in each small voxel (Frey et al. 2025)" in text.paragraphs[0]
    assert "traced at each time with LESS (Qi et al. 2019)" in text.paragraphs[0]
    assert "{" not in text.paragraphs[0]
    assert "Pimont" not in "".join(one for _, one in cited.items)
    assert "@article{frey2025," in bibtex.text
    assert bibtex.text.count("@") == len(cited.items)


def test_every_reference_is_an_entry_that_bibtex_can_read():
    for key, reference in REFERENCES.items():
        entry = reference.bibtex(key)
        assert entry.count("{") == entry.count("}")
        assert str(reference.year) in reference.cited()


# Other studies


def test_studies_without_a_verdict_open_with_what_they_found(tmp_path):
    shadowing = pd.DataFrame(
        {"design": ["single", "diamond"] * 2, "n_beams": [1, 1, 9, 9], "rs": [0.9, 0.9, 0.8, 0.5]}
    )
    page = written(tmp_path / "survey", {"survey/shadowing.csv": shadowing})
    assert (
        "With the finest scans, 50 % of the filled voxels stay unseen from the positions of "
        "diamond, the best of the designs, and 80 % from those of single."
    ) in page
    thresholds = pd.DataFrame(
        {"stressor": ["noise", "noise", "gap"], "level": [2.0, np.nan, 1.0],
         "reconstruction": ["polygons", "surfels", "polygons"]}
    )  # fmt: skip
    page = written(tmp_path / "stability", {"stability/thresholds.csv": thresholds})
    assert "Of 2 kinds of trouble" in page
    assert "0 for surfels, 2 for polygons" in page
    accuracy = pd.DataFrame(
        {"plot": "larch", "model": ["semi_less", "prosail"], "test_set": "field", "n": 12,
         "seed": "ensemble", "rmse": [4.0, 8.0]}
    )  # fmt: skip
    page = written(tmp_path / "plot", {"chlorophyll/accuracy.csv": accuracy})
    assert "nearest to 12 trees comes semi less with an RMSE of 4.00" in page


def test_a_long_table_is_folded_and_says_how_many_rows_it_has():
    rows = [[blocks.cell(k)] for k in range(blocks.MOST_ROWS + 1)]
    long, short = (
        blocks.Table("Light of a day", [quantity("n")], part) for part in (rows, rows[:-1])
    )
    page = document("a run", [], [Section("Light", [long, short])])
    assert page.count("<details") == 1
    assert f"<summary>Light of a day ({len(rows)} rows)</summary>" in page


def test_what_only_some_reconstructions_have_is_told_row_by_row(tmp_path):
    for name, facts in {
        "polygons": {"leaf_area_m2": 70.0, "voxel_size_m": 0.05},
        "voxels_0.2": {"leaf_area_m2": 80.0, "total_shots": 3},
    }.items():
        folder = tmp_path / "structure" / name
        folder.mkdir(parents=True)
        (folder / "summary.json").write_text(json.dumps(facts))
    all_of_them, single = numbers.structure(tmp_path)
    assert [column.label for column in all_of_them.columns] == ["reconstruction", "leaf area"]
    assert [[cell.text for cell in row] for row in single.rows] == [
        ["polygons", "voxel size", "0.0500", "m"],
        ["voxels 0.2 m", "total shots", "3", ""],
    ]
