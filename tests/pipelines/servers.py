# SPDX-License-Identifier: LGPL-2.1-or-later
"""Programs that serve, and what they complain of."""
import os
import re
import signal
import subprocess
import tempfile

# What libraries warn of when a client joins or leaves at an unusual moment; it does no harm.
HARMLESS = re.compile(r"libsoup-WARNING .* could not get remote address"
                      r"|GStreamer-WARNING .*<(funnel|rtpbin|rtpsession|recv_rtc?p_sink_)\d+:\w+>"
                      r" Sticky event misordering, got 'segment' before 'caps'")
COMPLAINT = re.compile(r"\(\S+:\d+\): \S+-(WARNING|CRITICAL|ERROR) ")
SECONDS = 60  # for anything that should happen at once


class ServerProcess:
    def __init__(self, *command):
        self._errors = tempfile.TemporaryFile("w+")  # pylint: disable=consider-using-with
        # Warnings do not end it, but fail the test at the end.
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=self._errors, text=True,
                                        env={**os.environ, "G_DEBUG": "fatal-criticals"})
        self.address = self.process.stdout.readline()
        if not self.address:
            self.process.kill()
            self._errors.seek(0)
            raise RuntimeError(f"{command} does not start: {self._errors.read()}")

    def descriptors(self):
        return len(os.listdir(f"/proc/{self.process.pid}/fd"))

    def memory(self):
        """Resident, in megabytes."""
        with open(f"/proc/{self.process.pid}/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE") / 1e6

    def interrupt(self):
        """Presses Ctrl-C."""
        self.process.send_signal(signal.SIGINT)
        try:
            status = self.process.wait(SECONDS)
        finally:
            self.process.kill()
            self._errors.seek(0)
            errors = self._errors.read()
            print(errors, end="")
        complaints = [line for line in errors.splitlines() if COMPLAINT.search(line) and not HARMLESS.search(line)]
        assert status == 0 and not complaints, f"exit status {status}, {complaints}"
