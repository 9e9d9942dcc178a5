"""A bare rosbridge server for benchmarks: a process of its own, no code of URC's.

What is published to /ask comes back on /answer. Whoever calls /flood gets as many messages on
/imu as its argument says, then the answer; whoever calls /count learns how many messages came.
"""

import asyncio
import json

from websockets.asyncio.server import ServerConnection, serve

IMU = {
    "header": {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "imu"},
    "orientation": {"x": 0.0381, "y": 0.1893, "z": 0.2393, "w": 0.9515},
    "orientation_covariance": [0.0] * 9,
    "angular_velocity": {"x": 0.01, "y": -0.02, "z": 0.5},
    "angular_velocity_covariance": [0.0] * 9,
    "linear_acceleration": {"x": 0.1, "y": 0.2, "z": 9.81},
    "linear_acceleration_covariance": [0.0] * 9,
}


async def talk(client: ServerConnection) -> None:
    count = 0
    imu = json.dumps({"op": "publish", "topic": "/imu", "msg": IMU})
    async for frame in client:
        said = json.loads(frame)
        if said["op"] == "publish":
            count += 1
            if said["topic"] == "/ask":
                answer = {"op": "publish", "topic": "/answer", "msg": said["msg"]}
                await client.send(json.dumps(answer))
        elif said["op"] == "call_service":
            values: dict[str, object] = {}
            if said["service"] == "/flood":
                for _ in range(said["args"]["count"]):
                    await client.send(imu)
            elif said["service"] == "/count":
                values, count = {"count": count}, 0
            answer = {"op": "service_response", "id": said["id"], "service": said["service"]}
            await client.send(json.dumps({**answer, "values": values, "result": True}))


async def main() -> None:
    async with serve(talk, "127.0.0.1", 0, compression=None, max_queue=64) as server:
        print(server.sockets[0].getsockname()[1], flush=True)
        await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main())
