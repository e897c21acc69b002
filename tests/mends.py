#!/usr/bin/env python3
"""Reverts the fixes of a motion review one at a time, and shows that a test detects each revert.

    tests/mends.py            all fixes, on a copy of the tree; prints the test that detects each
    tests/mends.py 3 5        only these findings
    tests/mends.py --check    only checks that each fix is still found in its file, and on record

The models run first; for faults outside their scope, the other tests named. Takes about ten
minutes. `tests/mends.txt` has the test that detects each, and when it last did. Exit status 1 if a
fix can be reverted undetected.
"""

import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.append(str(ROOT / ".ci"))
from ledger import Ledger  # noqa: E402

COPY = ROOT / "target" / "mends"
COMMENT = "# Written by tests/mends.py: number and SHA-256 of each fix, the test that detects its removal, and the date."
# A program of tests, and the test in it that fails.
OUTCOME = r"\w+: (\w+(::\w+)*|a test that does not end)"
# Including the build. A test that runs longer waits for something that the defect prevents.
PATIENCE_S = 300

# Number, effect without the fix, file, the fix, its replacement, other tests to run.
MENDS = [
    ("1", "a position node is stopped at an old position", "src/ikeya/master/role.rs",
     "node.status.filter(|&(_, at)| now - at < hold_age)", "node.status.filter(|_| hold_age >= Duration::ZERO)", []),
    ("1b", "a stop holds a position that was measured before the stop was asked for", "src/ikeya/master/stop.rs",
     "if let (Status::Position(position), None, true) = (status, self.hold, self.is_asked) {",
     "if let (Status::Position(position), None) = (status, self.hold) {", []),
    ("2", "a set-point is sent in the old mode after an answer in the other one", "src/ikeya/master/mode.rs",
     "(Some(known), None) if known != mode => Decision::Doubtful,",
     "(Some(known), None) if known != mode => Decision::Agreed,", []),
    ("3", "a stop is forgotten when its node becomes abnormal", "src/ikeya/master/strikes.rs",
     "        if let Some(stop) = &mut node.stop {\n            *stop = Stop::new(None, None);\n        } else if",
     "        if node.stop.take().is_some() {\n        } else if", []),
    ("3b", "a node that becomes abnormal under a set-point is owed nothing", "src/ikeya/master/strikes.rs",
     "} else if stops && was_commanded {", "} else if stops && was_commanded && false {", []),
    ("4", "a failing receiver blocks all sending", "src/drive/blocking.rs",
     "let mut result = self.receive();", "self.receive()?;\n        let mut result = Ok(());", []),
    ("4b", "the same in async calls", "src/drive/asynch.rs",
     "result = result.and(self.receive_async().await);", "self.receive_async().await?;", []),
    ("5", "the driver-enable pin stays on when the port fails", "src/drive/rs485.rs",
     "        let _ = self.release();\n        Err(Rs485Error::Port(error))",
     "        Err(Rs485Error::Port(error))", []),
    ("5b", "nothing is flushed after a receive error", "src/drive/blocking.rs",
     "        if self.sending.needs_flush() {", "        if result.is_ok() && self.sending.needs_flush() {", []),
    ("6", "a robot's application is given old commands", "src/ucp/robot/state.rs",
     "(self.command, self.is_command_new) = (self.command.halted(), true);",
     "self.command = self.command.halted();", ["drivers", "ucp_roles"]),
    ("7", "three motors: new set-points of one node starve the others", "src/ikeya/master/turns.rs",
     "Reason::SetPoint => self.had_set_point,", "Reason::SetPoint => 0,", ["ikeya_roles"]),
    ("8", "a host acknowledges a result that it has not kept", "src/ucp/host/state.rs",
     "let kept = self.events.keep(event).is_ok();", "let kept = self.events.keep(event).is_ok() || true;", []),
    ("8b", "a robot acknowledges a start that it has not reported", "src/ucp/robot/state.rs",
     "(repeated && waits) || self.events.keep(event).is_ok()",
     "(repeated && waits) || self.events.keep(event).is_ok() || true", []),
    ("8c", "a robot ends its bias request although it has not reported the biases", "src/ucp/robot/state.rs",
     "if self.events.newest(waits) == Some(&event) || self.events.keep(event).is_ok() {\n            self.bias_request.end();",
     "if self.events.newest(waits) == Some(&event) || self.events.keep(event).is_ok() || true {\n            self.bias_request.end();", []),
    ("9", "a calibration of a robot does not end with its result", "src/ucp/robot/state.rs",
     "self.calibration = self.calibration.filter(|it| it.kind != kind || !it.has_result);", "", []),
    ("10", "an old answer counts for a new calibration request", "src/ucp/host/calibration.rs",
     "if step != self.step || self.attempts == 0 || !is_its_kind {", "if self.attempts == 0 || !is_its_kind {", []),
    ("11", "biases are read when requested, not when sent", 3 * ["src/ucp/host/state.rs"] + ["src/ucp/host/send.rs"],
     ["    pub(super) biases_told: bool,", "            biases_told: false,", "            self.biases_due = Some(at);",
      "let stored = self.store.load();"],
     ["    pub(super) biases_told: bool,\n    pub(super) asked: (Option<ImuBias>, Option<MagBias>),",
      "            biases_told: false,\n            asked: (None, None),",
      "            self.biases_due = Some(at);\n            self.asked = self.store.load();",
      "let stored = self.asked;"], []),
    ("12", "a slave answers although more bytes have arrived", "src/ikeya/slave/role.rs",
     "            if !is_last {\n                self.overtake();\n            }", "            let _ = is_last;", []),
    ("12b", "a slave answers an hour late", "src/ikeya/slave/role.rs",
     "if now > answer.until {", "if now > answer.until && false {", []),
    ("12c", "the rest of an answer is sent after another request", "src/ikeya/slave/role.rs",
     "        self.sent.is_none()\n", "        false\n", ["adverse"]),
    ("13", "a frame of which no byte has left is sent, however late", "src/drive/sending.rs",
     "            Some(frame) if !self.outbox.is_empty() && now <= frame.left_at + silence => None,",
     "            None => None,\n            Some(frame) if !self.outbox.is_empty() && now <= frame.left_at + silence => None,", []),
    ("13b", "the rest of a set-point is sent after a stop", "src/ikeya/master/role.rs",
     "        self.has_sent_old_set_point()", "        self.has_sent_old_set_point() && false", ["adverse"]),
    ("13c", "the rest of a motor command is sent after a stop", "src/ucp/host/role.rs",
     "        self.state.has_sent_old_command()", "        self.state.has_sent_old_command() && false", ["adverse"]),
    ("14", "a stop on UCP is reported as sent before it is flushed", "src/drive/ucp/calls.rs",
     "(self.role.is_stop_sent() && self.is_sent()).then_some(())", "self.role.is_stop_sent().then_some(())", []),
    ("15", "an echo longer than 64 bytes counts as an error", "src/ikeya/master/echo.rs",
     "const LEN: usize = 8 * (8 + 8) + 4;", "const LEN: usize = 64;", ["ikeya_roles"]),
    ("16", "an answer counts although it is complete before its request has left", "src/ikeya/master/replies.rs",
     "if now < window.request_end + half_answer && !accepts_early {",
     "if now < window.request_end + half_answer && !accepts_early && false {", ["ikeya_roles"]),
    ("17", "a report is returned late, from a queue", "src/ucp/host/state.rs",
     "(self.last_report, self.is_report_new) = (Some(report), true);",
     "if !self.is_report_new {\n            (self.last_report, self.is_report_new) = (Some(report), true);\n        }", ["drivers", "ucp_roles"]),
    ("18", "the confirmation of a dropped set-point never ends", "src/ikeya/master/role.rs",
     "        if self.node_mut(node).drop_set_point() {", "        if self.node_mut(node).drop_set_point() && false {", []),
    ("20", "on two wires a slave obeys bytes inside another node's answer", "src/ikeya/slave/requests.rs",
     "let decoder = if is_two_wire {", "let decoder = if is_two_wire && false {", ["ikeya_roles"]),
    ("21", "an async port that fails at once does not let other tasks run", "src/drive/asynch.rs",
     "        if result.is_err() {\n            yield_once().await;\n        }\n        result\n    }\n\n    async fn round_async",
     "        result\n    }\n\n    async fn round_async", []),
    ("21b", "set-points continue after the application has died", "src/ikeya/master/dead_man.rs",
     "                if self.node(id).is_under_order {", "                if self.node(id).is_under_order && false {", []),
    ("22", "a motor command that starts an update is framed like any other", "src/ucp/motor.rs",
     "        if received.starts_update() {", "        if received.starts_update() && false {", ["ucp"]),
    ("U16", "a host begins with a ping instead of a stop", "src/ucp/host/motor.rs",
     "let command = if self.first == First::Due { latest.halted() } else { latest };", "let command = latest;", []),
    ("U16b", "after a cut-off frame a stop is sent only once", "src/ucp/host/motor.rs",
     "const BOTH: Self = Self::Due(2);", "const BOTH: Self = Self::Due(1);", []),
    ("I12", "a stop is paid by one answer", "src/ikeya/master/stop.rs",
     "const PAYMENTS: u8 = 2;", "const PAYMENTS: u8 = 1;", []),
    ("23", "an answer behind a failing receiver is taken for a later one", "src/drive/driver.rs",
     "self.has_overtaken |= !self.is_empty;", "self.has_overtaken |= false;", ["motion"]),
    ("23b", "a master takes bytes from before its request for the answer", "src/ikeya/master/role.rs",
     "self.window.take_if(|window| since < window.request_end);",
     "self.window.take_if(|window| since > window.deadline);", ["motion"]),
    ("24", "an answer counts although it may be that of an earlier request in the port", "src/ikeya/master/replies.rs",
     "now <= window.deadline && self.held != Held::Several", "now <= window.deadline", ["ikeya_roles"]),
    ("24b", "the next request is sent while the port holds one", "src/ikeya/master/replies.rs",
     "self.line_free = Some(now + HELD);", "", ["ikeya_roles"]),
    ("24c", "the next request is sent before the answer to one that left late", "src/ikeya/master/replies.rs",
     "                self.line_free = Some(answer_by);\n", "", ["ikeya_roles"]),
    ("24d", "a driver does not say that the port holds a request", "src/drive/driver.rs",
     "                    self.role.handle_taken(now);\n", "", ["drivers"]),
]


def without(mend):
    """The files of a fix, with their text without it."""
    number, _, files, olds, news, _ = mend
    if isinstance(files, str):
        files, olds, news = [files], [olds], [news]
    texts = {file: (ROOT / file).read_text() for file in files}
    for file, old, new in zip(files, olds, news, strict=True):
        if texts[file].count(old) != 1:
            sys.exit(f"{number}: {file} contains its fix {texts[file].count(old)} times: {old!r}")
        texts[file] = texts[file].replace(old, new)
    return texts


def copy_tree():
    """Copies the files known to git, next to the build directory of earlier copies."""
    tree = COPY / "tree"
    shutil.rmtree(tree, ignore_errors=True)
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True)
    for file in filter(None, files.stdout.split("\0")):
        if (ROOT / file).is_file():
            (tree / file).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / file, tree / file)
    return tree


def failing(tree, target):
    """The first failing test of this target; None if all pass."""
    command = ["cargo", "test", "--quiet", "-p", "axlewire", "--test", target]
    command += ["--target-dir", COPY / "target"]
    with subprocess.Popen(
        command, cwd=tree, text=True, start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as run:
        try:
            out, err = run.communicate(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            os.killpg(run.pid, signal.SIGKILL)
            return "a test that does not end"
    if "error: could not compile" in err:
        sys.exit(err)
    # The list of failures at the end of the output.
    names = re.findall(r"^    ([a-z0-9_:]+)$", out, re.MULTILINE)
    if (run.returncode != 0) != bool(names):
        sys.exit(out + err)
    return names[0] if names else None


def is_test(target, name):
    """Whether this program has this test: as a function, or in the list of the models."""
    *modules, function = name.split("::")
    files = [ROOT / f"tests/{target}.rs", *(ROOT / "tests" / target).glob(f"**/{modules[-1] if modules else '*'}.rs")]
    text = "".join(file.read_text() for file in files if file.is_file())
    made = rf"^ *(#\[test\]\n *(#\[.*\]\n *)*fn {function}\(|{function} deep_\w+:$)"
    return bool(re.search(made, text, re.MULTILINE)) or text and name == "a test that does not end"


def main(wanted):
    mends = [(mend, without(mend)) for mend in MENDS]
    ledger = Ledger(ROOT / "tests" / "mends.txt", COMMENT, {mend[0]: [mend[2:5]] for mend in MENDS}, OUTCOME)
    if unknown := set(wanted) - {mend[0] for mend in MENDS} - {"--check"}:
        sys.exit(f"no fix has this number: {', '.join(sorted(unknown))}")
    if wanted == ["--check"]:
        faults = ledger.faults()
        for number, outcome in ledger.outcomes().items():
            if not is_test(*outcome.split(": ")):
                faults.append(f"{number}: there is no such test: {outcome}")
        if faults:
            sys.exit("\n".join(faults))
        return print(f"{len(mends)} fixes are in place, and on record")
    tree = copy_tree()
    for target in {target for mend in MENDS for target in ["models", *mend[-1]]}:
        if failing(tree, target):
            sys.exit(f"tests/{target}.rs fails with all fixes in place")
    unseen = 0
    for (number, what, _, _, _, others), texts in mends:
        if wanted and number not in wanted:
            continue
        for file, text in texts.items():
            (tree / file).write_text(text)
        targets = ["models", *others]
        found = next((f"{target}: {name}" for target in targets if (name := failing(tree, target))), None)
        unseen += found is None
        print(f"{number:>4}  {what}: {found or 'NOT FOUND'}", flush=True)
        ledger.keep(number, found)
        for file in texts:
            shutil.copyfile(ROOT / file, tree / file)
    sys.exit(f"{unseen} can be reverted undetected" if unseen else None)


main(sys.argv[1:])
