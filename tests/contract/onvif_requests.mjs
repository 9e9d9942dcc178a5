// The requests of the package `onvif`, a client that others wrote, for the profile token “main”: a
// line of JSON with the envelope of each request, keyed by its name.
import { Cam } from "onvif";

const cam = new Cam({ hostname: "192.168.1.64", autoconnect: false });
const said = {};
cam._request = ({ body }) => {
    const [, name] = /<(?:s:)?Body[^>]*>\s*<([A-Za-z]+)/.exec(body);
    said[name] = body;
};
const ignored = () => {};
cam.getCapabilities(ignored);
cam.getProfiles(ignored);
cam.getStreamUri({ protocol: "RTSP", profileToken: "main" }, ignored);
cam.getStatus({ profileToken: "main" }, ignored);
cam.continuousMove({ profileToken: "main", x: 0.5, y: -0.25, timeout: 1000, onlySendPanTilt: true }, ignored);
cam.stop({ profileToken: "main", panTilt: true, zoom: true }, ignored);
cam.gotoHomePosition({ profileToken: "main" }, ignored);
console.log(JSON.stringify(said));
