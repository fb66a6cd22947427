"""Verbs that both programs have."""

from geomotion.errors import InvalidSetting
from geomotion.files import read_json
from geomotion.stages import compare, regression
from geomotion.stages.ingest import summary_table
from geomotion.stages.session import Session, VerbResult

NO_MOTION = 3  # no path, or one that the arm cannot take: an answer, not a mistake; scripts can tell it from both
EXECUTION_KEYS = frozenset(("evaluation", "obstacle", "tracking", "output", "reuse", "run", "runs", "check", "hydra"))


def ingest_verb(session: Session) -> VerbResult:
    """Read recordings, and show what is in them."""
    found = session.produce("ingest")
    summary = read_json(found.path("summary.json"))
    text = f"{summary_table(summary)}\n\npicture  {found.path('figures/demonstrations.png')}\ndata     {found.folder}"
    return VerbResult(text, session.document(summary=summary))


def report_verb(session: Session, step: str) -> VerbResult:
    """Write the report by one of the program's steps, with what a robot did or without."""
    path = str(session.produce(step).path("report.html"))
    return VerbResult(f"report  {path}", session.document(report=path))


def compare_verb(session: Session) -> VerbResult:
    """Scores of several trained runs, side by side."""
    runs: list[str] = session.config.runs
    if len(runs) < 2:
        raise InvalidSetting("runs", runs, "two or more trained runs, for example runs=[latest,1a2b3c4d]")
    documents = {}
    for run in runs:
        documents[run] = read_json(session.beside(run).produce("evaluate").path("scores.json"))
    comparison = compare.comparison(documents)
    session.tracker.log_document(session.command, "scores.json", comparison)
    return VerbResult(compare.comparison_table(comparison), session.document(comparison=comparison))


def check_verb(session: Session) -> VerbResult:
    """Compare the scores of a pinned experiment with its baseline."""
    evaluated = session.produce("evaluate")
    certificate = evaluated.folder / "certificate.json"  # of fields alone
    verdict = regression.check(
        session.config.check,
        read_json(evaluated.path("scores.json")),
        read_json(certificate) if certificate.exists() else None,
    )
    session.tracker.log_document(session.command, "scores.json", verdict.document)
    return VerbResult(verdict.text, session.document(**verdict.document), exit_code=0 if verdict.passed else 1)
