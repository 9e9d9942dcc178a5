"""A ROS 1 node between a bridge and a real master: run by Debian's own Python, which has rospy.

    rospy_glue.py TOPIC TYPE … -- TOPIC TYPE …

Publishes on the first topics what comes as lines of JSON on standard input, and prints as such
lines what it hears on the others. The messages are made and read by ROS's own types: a field that
they have not, or a type that does not fit, is an error here.
"""

import json
import sys

import genpy
import roslib.message
import rospy


def plain(value):
    if isinstance(value, genpy.Message):
        return {name: plain(getattr(value, name)) for name in value.__slots__}
    if isinstance(value, (genpy.Time, genpy.Duration)):
        return {"secs": value.secs, "nsecs": value.nsecs}
    if isinstance(value, (list, tuple)):
        return [plain(one) for one in value]
    return value


def tell(**line):
    sys.stdout.write(json.dumps(line) + "\n")
    sys.stdout.flush()


def pairs(words):
    return {
        name: roslib.message.get_message_class(kind)
        for name, kind in zip(words[::2], words[1::2], strict=True)
    }


def main():
    cut = sys.argv.index("--")
    rospy.init_node("urc_glue", disable_signals=True, disable_rosout=True)
    said = pairs(sys.argv[1:cut])
    talkers = {
        name: rospy.Publisher(name, kind, queue_size=10, latch=True) for name, kind in said.items()
    }
    for name, kind in pairs(sys.argv[cut + 1 :]).items():
        rospy.Subscriber(name, kind, lambda heard, name=name: tell(topic=name, msg=plain(heard)))
    tell(ready=True)
    for line in sys.stdin:
        given = json.loads(line)
        message = said[given["topic"]]()
        genpy.message.fill_message_args(message, [given["msg"]])
        talkers[given["topic"]].publish(message)


main()
