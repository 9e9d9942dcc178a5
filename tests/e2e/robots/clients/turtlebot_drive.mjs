// A drive with roslib, as its examples show it. Prints one line of JSON. Argument: the port.
import { Ros, Topic } from "roslib";

const WAIT_MS = 45000;
const TICK_MS = 100;

const ros = new Ros();
const late = setTimeout(() => {
  console.error(`not done within ${WAIT_MS} ms: ${JSON.stringify(found)}`);
  process.exit(1);
}, WAIT_MS);
const found = { moved: 0, beams: 0 };
await new Promise((resolve, reject) => {
  ros.on("connection", resolve);
  ros.on("error", reject);
  void ros.connect(`ws://127.0.0.1:${Number(process.argv[2])}`);
});
const drive = new Topic({ ros, name: "/cmd_vel", messageType: "geometry_msgs/msg/Twist" });
const scan = new Topic({ ros, name: "/scan", messageType: "sensor_msgs/msg/LaserScan" });
await new Promise((resolve) => scan.subscribe((message) => resolve((found.beams = message.ranges.length))));
const odometry = new Topic({ ros, name: "/odom", messageType: "nav_msgs/msg/Odometry" });
let begin;
const pushing = setInterval(() => drive.publish({ linear: { x: 0.2 }, angular: { z: 0 } }), TICK_MS);
await new Promise((resolve) =>
  odometry.subscribe(({ pose }) => {
    const { x, y } = pose.pose.position;
    begin ??= { x, y };
    found.moved = Math.hypot(x - begin.x, y - begin.y);
    if (found.moved > 0.02) resolve();
  }),
);
clearInterval(pushing);
drive.publish({ linear: { x: 0 }, angular: { z: 0 } });
await new Promise((resolve) =>
  odometry.subscribe(({ twist }) => twist.twist.linear.x === 0 && resolve()),
);
clearTimeout(late);
console.log(JSON.stringify(found));
ros.close();
process.exit(0);
