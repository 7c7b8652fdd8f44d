"""Command line of the calibration on known truth: python -m verification.calibration_truth report."""

import argparse
from pathlib import Path

from verification.command_line import Stage, run_command


def report(arguments: argparse.Namespace) -> None:
    """Write table and page of all claims."""
    import numpy as np
    from common.slices import read_slice

    from calibration.stages import read_calibration
    from catalogs.figures import style
    from common.event_table import read_events
    from verification.calibration_truth import claims
    from verification.calibration_truth.figure import draw
    from verification.calibration_truth.page import write_report
    from verification.calibration_truth.settings import SAME_LAW

    given = read_slice(arguments.settings)
    designed = np.array([number for number, trial in enumerate(given["trials"]) if trial["kind"] == "design"])
    made = {Path(path).stem: read_events(path) for path in arguments.records}
    rows, tests = [], []
    for terms in (("potency", "number"), ("potency", "number", "places", "sizes")):
        varied = given | {"calibration": given["calibration"] | {"terms": terms}}
        found = read_calibration(varied, arguments.trials, arguments.finer, arguments.record)
        tested = found.self_test(designed)
        tests.append((found, tested))
        rows += claims.self_test_claims(found, tested, designed)
        for case, catalogue in made.items():
            fit = claims.fit_to_catalogue(found, catalogue)
            if case == SAME_LAW:
                rows += claims.twin_claims(found, case, given["truth"], fit, wanted_flag=False)
            else:
                rows.append(claims.flag_claim(found, case, fit.posterior, wanted_flag=True))
        rows += claims.twin_claims(found, "record", given["record_truth"], found.fit, wanted_flag=False)
        blind = read_calibration(varied, arguments.trials, [], arguments.record)
        rows += claims.twin_claims(
            blind, "record, cells not corrected", given["record_truth"], blind.fit, wanted_flag=True
        )
        rows += claims.chain_claims(found, found.settings.quantities)
    found, tested = tests[0]
    true = np.array([found.rows.points[np.flatnonzero(found.rows.trials == trial)[0]] for trial in designed])
    with style.applied():
        write_report(rows, draw(tested, true, found.settings.quantities), Path(arguments.table), Path(arguments.page))


if __name__ == "__main__":
    run_command(
        "verification.calibration_truth",
        __doc__,
        Stage(report, ("settings", "trials+", "finer+", "record", "records+", "table", "page"), made="page"),
    )
