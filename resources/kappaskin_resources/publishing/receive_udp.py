"""Prints the contacts that `kappaskin publish SOURCE --udp 127.0.0.1:9870` sends."""

import json
import socket
import sys

port = int(sys.argv[1]) if len(sys.argv) > 1 else 9870
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
    receiver.bind(("127.0.0.1", port))  # "" to hear other machines as well
    last = None
    while True:
        message = json.loads(receiver.recv(65536))
        if message["kind"] == "contact":
            if last is not None and message["number"] > last + 1:
                print("lost", message["number"] - last - 1)
            last = message["number"]
            if message["present"]:
                x, y, force = (message[key] for key in ("x_m", "y_m", "force_N"))
                sd, age = message["force_sd_N"], message["age_s"]
                print(f"{x:.4f} m {y:.4f} m {force:.3f} +- {sd:.3f} N, {1e3 * age:.1f} ms old")
