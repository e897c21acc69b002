"""Live capture: tshark, through `axle extcap`, on lines that speak while it listens."""
import os
import random
import signal
import subprocess
import threading
import time
import tty

import corpora

PATIENCE_S = 30


def captured(user, axle, port, protocol, path, packets):
    """The packets that tshark captures on a port: it ends after this many, or some seconds."""
    command = ["tshark", "-q", "-i", "axle", "-o", f"extcap.axle.port:{port}",
               "-o", f"extcap.axle.protocol:{protocol}", "-c", packets,
               "-a", f"duration:{PATIENCE_S}", "-w", path, "-P", "-T", "fields",
               "-e", "frame.interface_name", "-e", f"axle_{protocol.removesuffix('-3')}.message"]
    extcap = user.home / ".local/lib/wireshark/extcap"
    out = user.run(command, env={"WIRESHARK_EXTCAP_DIR": str(extcap)})
    return [line.split("\t") for line in out.decode().splitlines()]


def of_rover(user, axle, path):
    """The reports of a simulated rover."""
    sim = user.popen([axle, "sim", "ucp", "--for", 2 * PATIENCE_S], stdout=subprocess.PIPE)
    try:
        port = sim.stdout.readline().decode().strip().removeprefix("pty: ")
        return captured(user, axle, port, "ucp", path, 100)
    finally:
        sim.terminate()
        sim.communicate()


def of_bus(user, axle, path):
    """A bus with two nodes whose traffic passes, some of it damaged."""
    master, slave = os.openpty()
    tty.setraw(slave)
    port = os.ttyname(slave)
    os.chmod(port, 0o666)
    # Exclusive use is wanted by the tool.
    os.close(slave)
    is_over, dice = threading.Event(), random.Random(7)

    def speak():
        while not is_over.wait(0.01):
            node = dice.choice((1, 3))
            answer = corpora.rps(0x55, node, dice.uniform(-5, 5)) if node == 1 else \
                corpora.bus(0x56, node, dice.randbytes(4))
            noise = b"\x00" if dice.random() < 0.2 else b""
            os.write(master, corpora.bus(0xAA, node))
            time.sleep(0.002)
            os.write(master, noise + answer)

    speaker = threading.Thread(target=speak)
    speaker.start()
    try:
        return captured(user, axle, port, "ikeya", path, 100)
    finally:
        is_over.set()
        speaker.join()
        os.close(master)


# A capture that does not end would last as long as this.
MOST_FAILING_S = 20


def of_failures(user, axle):
    """Captures that cannot begin must end by themselves: those that did not, in words."""
    extcap = user.home / ".local/lib/wireshark/extcap"
    hanging = []
    for settings, options in (({"port": "/dev/no-such-port", "protocol": "ucp"}, []),
                              ({"port": "/dev/null", "protocol": "ucp"}, ["-f", "tcp"]),
                              ({"port": "/dev/null", "protocol": "modbus"}, [])):
        command = ["tshark", "-q", "-i", "axle", "-a", "duration:3", *options]
        for name, value in settings.items():
            command += ["-o", f"extcap.axle.{name}:{value}"]
        tshark = user.popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                            env={"WIRESHARK_EXTCAP_DIR": str(extcap)}, start_new_session=True)
        try:
            tshark.wait(timeout=MOST_FAILING_S)
        except subprocess.TimeoutExpired:
            # With the programs that it has started: they would wait for ever.
            os.killpg(tshark.pid, signal.SIGKILL)
            tshark.wait()
            hanging.append(" ".join(map(str, command)))
    return hanging
