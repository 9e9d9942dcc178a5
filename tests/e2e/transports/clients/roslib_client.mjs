// A dialogue of roslib (JavaScript) with the bridge on the port given. Prints one line of JSON.
import { Action, Ros, Service, Topic } from "roslib";

const port = Number(process.argv[2]);
const WAIT_MS = 10000;

function within(what, work) {
  return new Promise((resolve, reject) => {
    const late = setTimeout(() => reject(new Error(`${what}: nothing within ${WAIT_MS} ms`)), WAIT_MS);
    work((value) => {
      clearTimeout(late);
      resolve(value);
    }, reject);
  });
}

const ros = new Ros();
await within("connect", (done, failed) => {
  ros.on("connection", done);
  ros.on("error", failed);
  void ros.connect(`ws://127.0.0.1:${port}`);
});

const found = {};
found.topics = await within("topics", (done, failed) => ros.getTopics(done, failed));
for (const compression of ["none", "cbor", "png"]) {
  const name = `/echo_${compression}`;
  const options = { ros, name, messageType: "std_msgs/String", compression };
  const topic = new Topic(options);
  found[compression] = await within(compression, (done) => {
    topic.subscribe(done);
    topic.publish({ data: `grüezi by ${compression}`, values: [1.5, null] });
  });
  topic.unsubscribe();
}
const reset = new Service({ ros, name: "/reset", serviceType: "std_srvs/Trigger" });
found.reset = await within("reset", (done, failed) => reset.callService({}, done, failed));
const nobody = new Service({ ros, name: "/nobody", serviceType: "std_srvs/Trigger" });
found.nobody = await within("nobody", (done) => nobody.callService({}, done, (why) => done({ why })));
const feedback = [];
const dock = new Action({ ros, name: "/dock", actionType: "irobot_create_msgs/action/Dock" });
found.dock = await within("dock", (done, failed) => {
  dock.sendGoal({}, done, (piece) => feedback.push(piece), failed);
});
console.log(JSON.stringify(found));
ros.close();
process.exit(0);
