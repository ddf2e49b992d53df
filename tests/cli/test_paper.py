"""`rtcomp paper`: every figure and claim, and what it cannot use."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from command import motion, refused, rtcomp, write

FIGURES = ["9a", "9b", "10", "11a", "11b", "12a", "12b", "13a", "13b", "14a", "14b", "15"]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    at = tmp_path_factory.mktemp("paper")
    run = rtcomp("paper", "--quick", "--out", "out", at=at)
    assert (run.returncode, run.stderr) == (0, ""), run.stderr
    (at / "stdout").write_text(run.stdout)
    return at


@pytest.mark.slow
def test_every_claim_has_a_verdict_and_a_number(made: Path) -> None:
    told = json.loads((made / "out" / "paper.json").read_text())
    assert told["format"] == "rtcomp paper 1" and told["recording"] is None
    printed = (made / "stdout").read_text()
    for claim in told["claims"]:
        assert isinstance(claim["holds"], bool)
        assert claim["criterion"] and claim["measured"] and claim["quantity"] and claim["unit"]
        assert claim["value"] is None or claim["value"] >= 0.0
        assert claim["name"] in printed
    names = [claim["name"] for claim in told["claims"]]
    assert len(set(names)) == len(names) >= 15
    assert told["claims_true"] + told["claims_false"] == len(names)
    holds = {claim["name"]: claim["holds"] for claim in told["claims"]}
    assert holds["convergence"] and holds["asymmetry-slows"] and not holds["noise"]
    assert len(re.findall(r" (?:true|false) ", printed)) >= len(names)


@pytest.mark.slow
def test_every_figure_is_on_the_page_beside_what_the_paper_reports(made: Path) -> None:
    told = json.loads((made / "out" / "paper.json").read_text())
    assert [figure["figure"] for figure in told["figures"]] == FIGURES
    page = (made / "out" / "paper.html").read_text()
    for figure in told["figures"]:
        assert f"Fig. {figure['figure']}: " in page
    assert page.count("The paper: ") == len(FIGURES)
    assert "in the place of the real" in page
    assert str(made) not in page


@pytest.mark.slow
def test_an_earlier_result_stays_unless_forced(made: Path) -> None:
    refused("paper", "--quick", "--out", "out", at=made, says=["--force"])


def test_what_cannot_be_used_is_one_line(tmp_path: Path) -> None:
    refused("paper", "no.csv", at=tmp_path, says=["no.csv"])
    (tmp_path / "text.csv").write_text("nothing to see here\n")
    refused("paper", "text.csv", at=tmp_path, says=["text.csv"])
    refused("paper", "--map", "position=q", at=tmp_path, says=["--map", "name the recording"])
    columns = motion()
    write(tmp_path / "log.csv", columns)
    refused("paper", "log.csv", at=tmp_path, says=["t_s"])
    own = ["--map", "time=time", "--map", "position=position", "--map", "voltage=voltage"]
    refused("paper", "log.csv", *own, at=tmp_path, says=["log.csv", "4 times in a row"])
    refused("paper", "log.csv", "--config", "no.yaml", at=tmp_path, says=["no.yaml"])
