"""Prints the contacts of `kappaskin publish SOURCE --foxglove`; needs `pip install websockets`."""

import json
import sys

from websockets.sync.client import connect

url = sys.argv[1] if len(sys.argv) > 1 else "ws://127.0.0.1:8765"
with connect(url, subprotocols=["foxglove.sdk.v1", "foxglove.websocket.v1"]) as server:
    for received in server:
        if isinstance(received, str):  # about the server and its channels
            for channel in json.loads(received).get("channels", []):
                if channel["topic"] == "/contact":
                    asked = {"id": 0, "channelId": channel["id"]}
                    server.send(json.dumps({"op": "subscribe", "subscriptions": [asked]}))
        else:  # 1 byte of kind, 4 of subscription, 8 of time in ns, then the message
            message = json.loads(received[13:])
            if message["present"]:
                force, sd = message["force_N"], message["force_sd_N"]
                print(f"{message['x_m']:.4f} m {message['y_m']:.4f} m {force:.3f} +- {sd:.3f} N")
