// Steps of pages on an unchanged roslibjs, one after the other. Run by `test_rosbridge.py`: address, then tokens.
// Each step checks what its client sees, and prints its name.
import assert from "node:assert/strict";
import { Action, ActionClient, Goal, Param, Ros, Service, TFClient, Topic } from "roslib";

const [address, ...tokens] = process.argv.slice(2);
const ANSWER_S = 40;

function within(promise, what) {
  let timer;
  const late = new Promise((_, reject) => {
    timer = setTimeout(() => reject(new Error(`${what} did not come`)), 1000 * ANSWER_S);
  });
  return Promise.race([promise, late]).finally(() => clearTimeout(timer));
}

function connected(token) {
  const ros = new Ros({ url: address });
  ros.told = [];
  ros.on("connection", () => ros.authenticate(token, "", "", "", 0, "", 0));
  ros.on("status", (status) => ros.told.push(status));
  ros.on("error", () => {}); // a lost connection
  return ros;
}

const call = (ros, name, args = {}) =>
  within(
    new Promise((done, failed) => new Service({ ros, name, serviceType: "" }).callService(args, done, failed)),
    name,
  );
const refused = (ros, name, args) => call(ros, name, args).then((got) => `not refused: ${JSON.stringify(got)}`, String);

/** Subscribe; the returned function waits for a message that fits. */
function reader(ros, name, messageType, options = {}) {
  const topic = new Topic({ ros, name, messageType, ...options });
  const waiting = new Set();
  topic.subscribe((message) => {
    for (const one of waiting) one(message);
  });
  const until = (fits = () => true) => {
    let take;
    const found = new Promise((done) => {
      take = (message) => fits(message) && done(message);
      waiting.add(take);
    });
    return within(found, name).finally(() => waiting.delete(take));
  };
  return Object.assign(until, { topic });
}

const perform = (ros, name, actionType, goal, feedback = () => {}) =>
  new Promise((done, failed) => new Action({ ros, name, actionType }).sendGoal(goal, done, feedback, failed));

const [operator, staff, observer] = tokens.map(connected);
const drive = new Topic({ ros: operator, name: "/cmd_vel", messageType: "geometry_msgs/Twist" });
const PLAY = ["/play_motion", "play_motion_msgs/PlayMotionAction"];

const steps = {
  async asksAboutTheRobot() {
    const ask = (method, ...args) =>
      within(new Promise((done, failed) => operator[method](...args, done, failed)), method);
    assert((await ask("getTopics")).topics.includes("/scan_raw"));
    assert.equal(await ask("getTopicType", "/scan_raw"), "sensor_msgs/LaserScan");
    assert.equal(await ask("getServiceType", "/play_motion/list_motions"), "play_motion_msgs/ListMotions");
    assert((await ask("getActionServers")).includes("/tts"));
    assert((await ask("getServices")).includes("/fleet/take_control"));
    const typedefs = await ask("getMessageDetails", "geometry_msgs/Twist");
    assert.equal(operator.decodeTypeDefs(typedefs).linear.x, "float64");
    const raw = await ask("getTopicsAndRawTypes");
    assert.match(raw.typedefs_full_text[raw.topics.indexOf("/scan_raw")], /float32\[\] ranges/);
    const publishers = new Topic({ ros: operator, name: "/scan_raw", messageType: "sensor_msgs/LaserScan" });
    assert.equal((await new Promise((done, failed) => publishers.getPublishers(done, failed))).length, 1);
    const description = new Param({ ros: operator, name: "/robot_description" });
    assert.match(await new Promise((done, failed) => description.get(done, failed)), /^<robot/);
  },

  async isToldWhyWithoutControl() {
    const told = reader(operator, "/fleet/status", "fleet/Status");
    const why = told();
    drive.publish({ linear: { x: 0.2 } });
    assert.match((await why).msg, /^no_lease: /);
    assert.match(await refused(observer, "/fleet/take_control"), /^role_too_low: /);
    assert.match(String(await perform(operator, ...PLAY, { motion_name: "home" }).catch(String)), /no_lease: /);
    told.topic.unsubscribe();
  },

  async drivesAt100Hz() {
    const odometry = reader(operator, "/mobile_base_controller/odom", "nav_msgs/Odometry");
    const { x, y } = (await odometry()).pose.pose.position;
    assert.equal((await call(operator, "/fleet/take_control")).state, "yours");
    const timer = setInterval(() => drive.publish({ linear: { x: 0.1 }, angular: { z: 0.5 } }), 10);
    await odometry(({ pose: { pose } }) => Math.hypot(pose.position.x - x, pose.position.y - y) > 0.1);
    clearInterval(timer);
    await odometry(({ twist: { twist } }) => Math.abs(twist.linear.x) < 0.01);
    odometry.topic.unsubscribe();
  },

  async performsActionsInBothStyles() {
    const heard = [];
    const speak = { rawtext: { text: "One two three", lang_id: "en_GB" } };
    const said = await perform(operator, "/tts", "pal_interaction_msgs/TtsAction", speak, (one) => heard.push(one));
    assert.equal(said.text, "One two three");
    assert(heard.length);
    const unknown = await perform(operator, ...PLAY, { motion_name: "nonsense" }).catch(String);
    assert.match(unknown, /unknown_motion: /);
    const actionClient = new ActionClient({ ros: operator, serverName: PLAY[0], actionName: PLAY[1] });
    const goal = new Goal({ actionClient, goalMessage: { motion_name: "wave" } });
    const running = new Promise((done) => goal.on("status", (status) => status.status === 1 && done()));
    const result = new Promise((done) => goal.on("result", done));
    goal.send();
    await within(running, "the motion");
    actionClient.cancel(); // an empty cancel
    await within(result, "the end of the motion");
    assert.equal(goal.status.status, 2);
    await perform(operator, ...PLAY, { motion_name: "home" });
  },

  async turnsTheHeadUntilItIsThere() {
    const joints = reader(operator, "/joint_states", "sensor_msgs/JointState");
    const pan = async () => {
      const { name, position } = await joints();
      return position[name.indexOf("head_1_joint")];
    };
    const heard = [];
    const [name, actionType] = ["/head_controller/point_head_action", "control_msgs/PointHeadAction"];
    const target = (y) => ({ target: { header: { frame_id: "base_footprint" }, point: { x: 1, y, z: 1.1 } } });
    await within(
      perform(operator, name, actionType, target(1), (one) => heard.push(one)),
      name,
    );
    assert(Math.abs((await pan()) - Math.PI / 4) < 0.1 && heard.length);
    const follow = ["/head_controller/follow_joint_trajectory", "control_msgs/FollowJointTrajectoryAction"];
    const points = [{ positions: [-0.5, 0], time_from_start: { secs: 1, nsecs: 0 } }];
    const trajectory = { joint_names: ["head_1_joint", "head_2_joint"], points };
    await within(perform(operator, ...follow, { trajectory }), follow[0]);
    assert(Math.abs((await pan()) + 0.5) < 0.1);
    const action = new Action({ ros: operator, name, actionType });
    const cancelled = new Promise((done) => {
      const id = action.sendGoal(target(5), done, () => action.cancelGoal(id), done);
    });
    assert.match(String(await within(cancelled, "the end of a cancelled turn")), /canceled/);
    assert((await pan()) < 1.0);
    joints.topic.unsubscribe();
  },

  async followsAFrame() {
    const frames = new TFClient({ ros: observer, fixedFrame: "odom", angularThres: 0.01, rate: 10 });
    const transform = await within(new Promise((done) => frames.subscribe("base_footprint", done)), "a transform");
    assert(Number.isFinite(transform.translation.x));
    frames.dispose();
  },

  async readsMapsAndPicturesInEachForm() {
    for (const compression of ["none", "png", "cbor"]) {
      const map = reader(observer, "/map", "nav_msgs/OccupancyGrid", { compression });
      const { info, data } = await map().catch((error) => {
        throw new Error(`${error.message} as ${compression}: ${JSON.stringify(observer.told)}`);
      });
      assert.equal(data.length, info.width * info.height, compression);
      map.topic.unsubscribe();
    }
    const picture = ["/xtion/rgb/image_raw/compressed", "sensor_msgs/CompressedImage"];
    const text = reader(observer, ...picture, { throttle_rate: 500 });
    assert.equal(Buffer.from((await text()).data, "base64")[0], 0xff);
    text.topic.unsubscribe();
    const bytes = reader(observer, ...picture, { compression: "cbor" });
    assert.equal((await bytes()).data[0], 0xff);
    bytes.topic.unsubscribe();
    const raw = reader(observer, "/scan_raw", "sensor_msgs/LaserScan", { compression: "cbor-raw" });
    const { bytes: body, secs } = await raw();
    assert(body.length > 100 && secs > 0);
    raw.topic.unsubscribe();
  },

  async offersServicesAndActions() {
    const service = new Service({ ros: operator, name: "/add_two_ints", serviceType: "rospy_tutorials/AddTwoInts" });
    service.advertise(({ a, b }, response) => {
      response.sum = a + b;
      return true;
    });
    const action = new Action({
      ros: operator,
      name: "/fibonacci",
      actionType: "actionlib_tutorials/FibonacciAction",
    });
    action.advertise(
      ({ order }, id) => {
        action.sendFeedback(id, { sequence: [0, 1] });
        if (order < 10) action.setSucceeded(id, { sequence: [0, 1, 1, 2] });
      },
      (id) => action.setCanceled(id, { sequence: [] }),
    );
    await call(operator, "/rosapi/get_time"); // its answer comes after the offers
    assert.deepEqual(await call(staff, "/fleet/clients/add_two_ints", { a: 2, b: 3 }), { sum: 5 });
    const heard = [];
    const fibonacci = ["/fleet/clients/fibonacci", "actionlib_tutorials/FibonacciAction"];
    const result = await perform(staff, ...fibonacci, { order: 3 }, (one) => heard.push(one));
    assert.deepEqual([heard, result.sequence], [[{ sequence: [0, 1] }], [0, 1, 1, 2]]);
    const other = new Action({ ros: staff, name: fibonacci[0], actionType: fibonacci[1] });
    const cancelled = await new Promise((done) => {
      const id = other.sendGoal({ order: 20 }, done, () => other.cancelGoal(id), done);
    });
    assert.match(String(cancelled), /canceled/);
    await service.unadvertise();
    action.unadvertise();
  },

  async reconnects() {
    const scan = reader(operator, "/scan_raw", "sensor_msgs/LaserScan", { throttle_rate: 200 });
    await scan();
    operator.close();
    await within(new Promise((done) => operator.once("close", done)), "the close");
    const again = scan();
    await operator.connect(address);
    await again;
    assert.match(await refused(operator, "/fleet/renew_control"), /^no_lease: /);
  },

  async staffCallServicesAndSetParameters() {
    assert.equal((await call(staff, "/fleet/take_control")).state, "yours");
    const { motions } = await call(staff, "/play_motion/list_motions");
    assert(motions.some(({ name }) => name === "wave"));
    const greeting = new Param({ ros: staff, name: "/fleet_demo/greeting" });
    const done = (method, ...args) => new Promise((ok, failed) => greeting[method](...args, ok, failed));
    await done("set", { words: ["hello", 5] });
    assert.deepEqual(await done("get"), { words: ["hello", 5] });
    await done("delete");
    assert.match(await refused(staff, "/gripper_controller/grasp"), /^not_allowed: /);
    await call(staff, "/fleet/release_control");
  },
};

for (const [name, step] of Object.entries(steps)) {
  const began = performance.now();
  await step();
  console.log(name, ((performance.now() - began) / 1000).toFixed(1), "s");
}
process.exit(0);
