export default { mount() { return {}; } };
