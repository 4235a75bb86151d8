"""A child process leaves a message that its parent reads."""

from ibe_rl.runtime.child_errors import ChildErrors, report_error


def test_the_first_message_is_read_and_nothing_stays():
    child_errors = ChildErrors()
    assert child_errors.first() is None
    report_error(child_errors.folder, "the cable broke")
    assert child_errors.first() == "the cable broke"
    folder = child_errors.folder
    del child_errors
    assert not folder.exists()
