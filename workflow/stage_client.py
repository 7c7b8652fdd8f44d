"""A program that stands for a stage which runs as a copy of the stage server (workflow/stage_server.py).

    python -IS workflow/stage_client.py <words of the interpreter>

It ends as the stage does, and passes on what it is signalled. Without a server the stage runs here. It imports next to
nothing, for it is started once for each stage.
"""

import os
import signal
import socket
import sys

ADDRESS = "STAGE_SERVER"  # environment variable: the server's name among Linux's abstract sockets
PASSED_ON = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
LOST = "the process that runs the stages has ended; run snakemake again"


def main() -> None:
    """Have the stage run by the server, or run it."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as server:
        try:
            server.connect(f"\0{os.environ[ADDRESS]}")
        except (KeyError, OSError):
            os.execv(sys.executable, [sys.executable, *sys.argv[1:]])
        # The server looks at this process's words, folder, environment and limits.
        socket.send_fds(server, [b"."], [0, 1, 2])
        for number in PASSED_ON:
            if signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, lambda number, frame: server.send(bytes([number])))
        status = server.recv(1)
    sys.exit(status[0] if status else LOST)


if __name__ == "__main__":
    main()
