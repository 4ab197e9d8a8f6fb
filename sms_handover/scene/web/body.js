"use strict";
/* One run in the 3D view: its solids, frames and traces, placed at any time from the recorded poses. */

const COLOURS = { // of arms in order, of the deputy, of edges; distinguishable by colour-blind viewers
  light: { arms: [0x1c74b8, 0xd2601a, 0x8a5a9e, 0x4b8b3b], deputy: 0x0f9d6b, edge: 0x1d2530, start: 0x69788c, apart: 0x18202b, momentum: 0xb0307a, inside: 0xd00000 },
  dark: { arms: [0x58b4ff, 0xff9a4d, 0xc79be0, 0x93d07f], deputy: 0x2fe0a0, edge: 0x05080f, start: 0x8ea2bd, apart: 0xe8edf4, momentum: 0xff7ac0, inside: 0xff4a4a },
};
const GHOST_OPACITY = 0.3;
const EDGE_ANGLE = 30; // degrees, smallest angle between two faces whose common edge is drawn
const AXIS_LENGTH = 0.16; // m
const TRACE_WIDTH = 2.5; // px
const PLANNED_WIDTH = 4; // px
const PLANNED_SHOWN = 0.5; // s for which a plan is shown where no other takes its place
const MOMENTUM_LENGTH = 0.6; // m, of the arrow of the largest angular momentum of a run

/** Decode base64 of little-endian floats. */
function numbers(text, Type) {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i += 1) bytes[i] = raw.charCodeAt(i);
  return new Type(bytes.buffer);
}

/** The last of the first `count` instants not after t, the first one if all are. */
function latest(times, count, t) {
  let low = 0;
  let high = count - 1;
  while (low < high) {
    const middle = Math.ceil((low + high) / 2);
    if (times[middle] <= t) low = middle; else high = middle - 1;
  }
  return low;
}

/** The poses of named bodies over time, interpolated between recorded instants. */
class Motion {
  constructor(data) {
    this.bodies = data.bodies;
    this.times = numbers(data.times, Float64Array); // s; the first `count` of these and of the poses are in use
    this.poses = numbers(data.poses, Float32Array); // per instant and body x y z, quaternion x y z w
    this.count = this.times.length;
    this.other = { position: new THREE.Vector3(), quaternion: new THREE.Quaternion() };
  }

  get start() { return this.times[0]; }

  get end() { return this.times[this.count - 1]; }

  /** Append new instants. */
  append(data) {
    const times = numbers(data.times, Float64Array);
    const width = this.bodies.length * 7;
    if (this.count + times.length > this.times.length) {
      const room = 2 * (this.count + times.length);
      const [oldTimes, oldPoses] = [this.times, this.poses];
      this.times = new Float64Array(room);
      this.poses = new Float32Array(room * width);
      this.times.set(oldTimes.subarray(0, this.count));
      this.poses.set(oldPoses.subarray(0, this.count * width));
    }
    this.times.set(times, this.count);
    this.poses.set(numbers(data.poses, Float32Array), this.count * width);
    this.count += times.length;
  }

  /** The last recorded instant not after t. */
  index(t) { return latest(this.times, this.count, t); }

  read(index, body, position, quaternion) {
    const at = (index * this.bodies.length + body) * 7;
    position.fromArray(this.poses, at);
    quaternion.fromArray(this.poses, at + 3);
  }

  /** Write the pose of a body at time t to position and quaternion; false where it was not recorded. */
  at(t, body, position, quaternion) {
    const index = this.index(t);
    this.read(index, body, position, quaternion);
    if (index + 1 < this.count && t > this.times[index]) {
      const { position: p, quaternion: q } = this.other;
      this.read(index + 1, body, p, q);
      const part = (t - this.times[index]) / (this.times[index + 1] - this.times[index]);
      position.lerp(p, part);
      quaternion.slerp(q, part);
    }
    return !Number.isNaN(position.x);
  }

  /** The path of a body's origin; instants that were not recorded are left out. */
  path(body) {
    const points = [];
    const rows = [];
    for (let i = 0; i < this.count; i += 1) {
      const at = (i * this.bodies.length + body) * 7;
      if (!Number.isNaN(this.poses[at])) {
        points.push(this.poses[at], this.poses[at + 1], this.poses[at + 2]);
        rows.push(i);
      }
    }
    return { points, rows };
  }
}

/** A line drawn up to the current time, and faintly to its end. */
class Trace {
  constructor(motion, body, group) {
    this.motion = motion;
    this.body = body;
    this.past = this.line(TRACE_WIDTH, 0.95);
    this.whole = this.line(TRACE_WIDTH * 0.5, 0.28);
    group.add(this.whole, this.past);
    this.rebuild();
  }

  line(width, opacity) {
    const material = new THREE.LineMaterial({ linewidth: width, transparent: true, opacity, depthWrite: false });
    const line = new THREE.Line2(new THREE.LineGeometry(), material);
    line.frustumCulled = false;
    return line;
  }

  /** Rebuild both lines from the path. */
  rebuild() {
    const { points, rows } = this.motion.path(this.body);
    this.rows = rows;
    [this.past, this.whole].forEach((line) => {
      line.visible = rows.length > 1;
      line.geometry.dispose();
      line.geometry = new THREE.LineGeometry();
      if (line.visible) line.geometry.setPositions(points);
    });
  }

  show(index) {
    if (!this.past.visible) return;
    let count = 0;
    while (count < this.rows.length && this.rows[count] <= index) count += 1;
    this.past.geometry.instanceCount = Math.max(0, count - 1);
  }

  colour(value) {
    this.past.material.color.set(value);
    this.whole.material.color.set(value);
  }
}

/** The two bodies that are nearest to each other: a line between their nearest points, red where they are in each other. */
class Nearest {
  constructor(data, motion, group) {
    this.motion = motion; // its instants are those of the distances
    this.pairs = data.pairs;
    this.pair = numbers(data.pair, Uint16Array);
    this.distances = numbers(data.distances, Float32Array); // m
    this.points = numbers(data.points, Float32Array); // m, per instant a point of the first and of the second body
    this.middle = new THREE.Vector3();
    this.colours = COLOURS.light;
    const above = { depthTest: false, transparent: true }; // seen through the bodies it lies in
    this.line = new THREE.Line2(new THREE.LineGeometry(), new THREE.LineMaterial({ linewidth: 3, ...above }));
    this.line.frustumCulled = false;
    this.ball = new THREE.MeshStandardMaterial({ color: 0x000000, ...above });
    this.ends = [0, 1].map(() => new THREE.Mesh(new THREE.SphereGeometry(0.008, 16, 12), this.ball));
    [this.line, ...this.ends].forEach((part) => { part.renderOrder = 1; group.add(part); });
  }

  /** Move to time t; between two instants the points go straight on if the pair is the same. */
  place(t) {
    const index = this.motion.index(t);
    const { times } = this.motion;
    const between = index + 1 < this.motion.count && t > times[index] && this.pair[index] === this.pair[index + 1];
    const part = between ? (t - times[index]) / (times[index + 1] - times[index]) : 0;
    const mixed = (values, width, place) => {
      const value = values[index * width + place];
      return part ? value + part * (values[(index + 1) * width + place] - value) : value;
    };
    const ends = [0, 1, 2, 3, 4, 5].map((place) => mixed(this.points, 6, place));
    this.distance = mixed(this.distances, 1, 0);
    this.known = !ends.some(Number.isNaN);
    [this.line, ...this.ends].forEach((each) => { each.visible = this.known; });
    if (!this.known) return;
    this.name = this.pairs[this.pair[index]];
    this.line.geometry.setPositions(ends);
    this.ends.forEach((end, place) => end.position.fromArray(ends, 3 * place));
    this.middle.addVectors(this.ends[0].position, this.ends[1].position).multiplyScalar(0.5);
    this.paint(this.colours);
  }

  get colour() { return this.distance < 0 ? this.colours.inside : this.colours.apart; }

  paint(colours) {
    this.colours = colours;
    this.line.material.color.set(this.colour);
    this.ball.emissive.set(this.colour); // no shading: a mark, not a body
  }

  /** The signed distance in mm as text. */
  get text() { return this.known ? `${(1000 * this.distance).toFixed(1).replace("-", "\u2212")} mm` : "\u2013"; }
}

/** Centre of mass of robot and deputy as a ball, and their angular momentum about it as an arrow. */
class Momentum {
  constructor(data, motion, group) {
    this.motion = motion; // its instants are those of the momentum
    this.centres = numbers(data.centres, Float32Array); // m, x y z per instant
    this.angular = numbers(data.angular, Float32Array); // kg m^2/s, x y z per instant
    const sizes = Array.from({ length: this.angular.length / 3 }, (_, i) => Math.hypot(...this.angular.subarray(3 * i, 3 * i + 3)));
    this.scale = MOMENTUM_LENGTH / Math.max(...sizes.filter((size) => !Number.isNaN(size)));
    this.centre = new THREE.Vector3();
    this.vector = new THREE.Vector3();
    this.tip = new THREE.Vector3();
    const above = { depthTest: false, transparent: true }; // seen through the spacecraft it lies in
    this.line = new THREE.Line2(new THREE.LineGeometry(), new THREE.LineMaterial({ linewidth: 4, ...above }));
    this.line.frustumCulled = false;
    this.material = new THREE.MeshStandardMaterial({ color: 0x000000, ...above });
    this.ball = new THREE.Mesh(new THREE.SphereGeometry(0.02, 20, 14), this.material);
    this.head = new THREE.Mesh(new THREE.CylinderGeometry(0, 0.022, 0.06, 20), this.material);
    this.up = new THREE.Vector3(0, 1, 0); // along the head
    [this.line, this.ball, this.head].forEach((part) => { part.renderOrder = 1; group.add(part); });
  }

  /** Write a vector at time t, straight on between two instants. */
  read(values, t, vector) {
    const index = this.motion.index(t);
    const { times } = this.motion;
    vector.fromArray(values, 3 * index);
    if (index + 1 < this.motion.count && t > times[index]) {
      const part = (t - times[index]) / (times[index + 1] - times[index]);
      vector.lerp(this.tip.fromArray(values, 3 * index + 3), part);
    }
  }

  /** Move to time t. */
  place(t) {
    this.read(this.centres, t, this.centre);
    this.read(this.angular, t, this.vector);
    this.size = this.vector.length(); // kg m^2/s
    this.known = !Number.isNaN(this.size + this.centre.x);
    [this.line, this.ball, this.head].forEach((each) => { each.visible = this.known; });
    if (!this.known) return;
    this.tip.copy(this.centre).addScaledVector(this.vector, this.scale);
    this.line.geometry.setPositions([...this.centre.toArray(), ...this.tip.toArray()]);
    this.ball.position.copy(this.centre);
    this.head.position.copy(this.tip);
    this.head.quaternion.setFromUnitVectors(this.up, this.vector.clone().normalize());
  }

  paint(colour) {
    this.line.material.color.set(colour);
    this.material.emissive.set(colour); // no shading: a mark, not a body
  }

  /** Its size as text. */
  get text() { return this.known ? `${this.size.toPrecision(3)} kg m\u00b2/s` : "\u2013"; }
}

/** Where the plans of a predictive law lead the tools: a line per arm, from the latest plan not after the time. */
class Planned {
  constructor(arms, group) {
    this.times = []; // s, of the plans
    this.paths = []; // m, per plan and arm the x y z of the instants of its horizon
    this.lines = arms.map(() => {
      const above = { depthTest: false, transparent: true }; // seen through the arms and the deputy
      const dashes = { dashed: true, dashSize: 0.02, gapSize: 0.012 }; // m
      const line = new THREE.Line2(new THREE.LineGeometry(), new THREE.LineMaterial({ linewidth: PLANNED_WIDTH, ...dashes, ...above }));
      line.frustumCulled = false;
      line.renderOrder = 1;
      group.add(line);
      return line;
    });
  }

  /** Add plans; all of one call have lines of `size` points. */
  append({ times, points, size }) {
    const all = numbers(points, Float32Array);
    numbers(times, Float64Array).forEach((time, plan) => {
      this.times.push(time);
      this.paths.push(this.lines.map((_, arm) => {
        const begin = 3 * size * (plan * this.lines.length + arm);
        return all.subarray(begin, begin + 3 * size);
      }));
    });
  }

  /** Show the plan at time t; none after the last one has ended. */
  place(t) {
    const index = latest(this.times, this.times.length, t + 1e-9);
    const age = t - this.times[index]; // s, NaN without plans
    const shown = age >= -1e-9 && age <= PLANNED_SHOWN;
    this.lines.forEach((line, arm) => {
      const points = shown ? this.paths[index][arm] : [];
      line.visible = points.length > 0 && !Number.isNaN(points[0]);
      if (!line.visible) return;
      line.geometry.dispose();
      line.geometry = new THREE.LineGeometry();
      line.geometry.setPositions(points);
      line.computeLineDistances(); // of the dashes
    });
  }

  paint(colours) { this.lines.forEach((line, arm) => line.material.color.set(colours.arms[arm % 4])); }
}

/** Everything drawn of one run, as a group that moves with time. */
class RunBody {
  constructor(data) {
    this.name = data.name;
    this.data = data;
    this.motion = new Motion(data);
    this.group = new THREE.Group();
    this.traceGroup = new THREE.Group();
    this.targetGroup = new THREE.Group();
    this.startGroup = new THREE.Group();
    this.nearestGroup = new THREE.Group();
    this.momentumGroup = new THREE.Group();
    this.plannedGroup = new THREE.Group();
    this.group.add(this.traceGroup, this.targetGroup, this.startGroup, this.nearestGroup, this.momentumGroup, this.plannedGroup);
    this.painted = []; // { material, role, arm } to recolour when the theme changes
    this.bodies = this.motion.bodies.map(() => new THREE.Group());
    this.bodies.forEach((body) => this.group.add(body));
    data.shapes.forEach((shape) => this.addShape(shape));
    this.addDeputy(data.deputy_size);
    this.traces = data.arms.map((arm, index) => this.addArm(arm, index));
    this.basePath = new Trace(this.motion, 0, this.traceGroup);
    this.nearest = data.clearance ? new Nearest(data.clearance, this.motion, this.nearestGroup) : null;
    this.momentum = data.momentum ? new Momentum(data.momentum, this.motion, this.momentumGroup) : null;
    this.planned = new Planned(data.arms, this.plannedGroup);
    if (data.planned) this.planned.append(data.planned);
    this.drawStart();
  }

  body(name) { return this.motion.bodies.indexOf(name); }

  armOf(link) { return this.data.arms.findIndex((arm) => link.startsWith(`${arm}_`)); }

  addShape(shape) {
    const geometry = shape.kind === "box"
      ? new THREE.BoxGeometry(...shape.size)
      : new THREE.CylinderGeometry(shape.size[0], shape.size[0], shape.size[1], 48).rotateX(Math.PI / 2);
    const colour = new THREE.Color().setRGB(...shape.rgba.slice(0, 3), THREE.SRGBColorSpace);
    const arm = this.armOf(shape.link);
    const role = arm >= 0 && colour.getHSL({}, THREE.SRGBColorSpace).l > 0.5 ? "arm" : "own"; // dark parts keep their colour
    const mesh = this.solid(geometry, { role, arm, own: colour });
    mesh.position.fromArray(shape.pose, 0);
    mesh.quaternion.fromArray(shape.pose, 3);
    this.bodies[this.body(shape.link)].add(mesh);
    if (shape.kind === "cylinder") this.addJoint(shape, mesh);
  }

  /** Round the end of a cylinder that begins at its link's joint, so that the arm has no gaps. */
  addJoint(shape, mesh) {
    const [radius, length] = shape.size;
    if (Math.abs(mesh.position.length() - length / 2) > 1e-6) return;
    const ball = new THREE.Mesh(new THREE.SphereGeometry(radius, 32, 20), mesh.material);
    ball.castShadow = true;
    ball.receiveShadow = true;
    this.bodies[this.body(shape.link)].add(ball);
  }

  solid(geometry, paint) {
    const material = new THREE.MeshStandardMaterial({ roughness: 0.55, metalness: 0.1 });
    const mesh = new THREE.Mesh(geometry, material);
    mesh.castShadow = true;
    mesh.receiveShadow = true;
    const lines = new THREE.LineSegments(
      new THREE.EdgesGeometry(geometry, EDGE_ANGLE),
      new THREE.LineBasicMaterial({ transparent: true, opacity: 0.55 }),
    );
    mesh.add(lines);
    this.painted.push({ ...paint, material, lines: lines.material, mesh });
    return mesh;
  }

  addDeputy(size) {
    const mesh = this.solid(new THREE.BoxGeometry(...size), { role: "deputy", arm: -1 });
    this.bodies[this.body("deputy")].add(mesh);
    const measured = this.bodies[this.body("deputy/measured")];
    if (!measured) return; // a run without sensors
    measured.add(this.solid(new THREE.BoxGeometry(...size), { role: "measured", arm: -1 }));
    this.targetGroup.add(measured);
  }

  addArm(arm, index) {
    const frame = this.bodies[this.body(`${arm}/target`)];
    this.targetGroup.add(frame);
    [[1, 0, 0, 0xe0433a], [0, 1, 0, 0x3aa83f], [0, 0, 1, 0x3a6fe0]].forEach(([x, y, z, colour]) => {
      const geometry = new THREE.LineGeometry();
      geometry.setPositions([0, 0, 0, x * AXIS_LENGTH, y * AXIS_LENGTH, z * AXIS_LENGTH]);
      frame.add(new THREE.Line2(geometry, new THREE.LineMaterial({ linewidth: 3, color: colour })));
    });
    const ball = new THREE.Mesh(new THREE.SphereGeometry(0.014, 20, 14), new THREE.MeshStandardMaterial({ roughness: 0.6 }));
    frame.add(ball);
    this.painted.push({ role: "target", arm: index, material: ball.material, mesh: ball });
    return new Trace(this.motion, this.body(`${arm}_tool`), this.traceGroup);
  }

  /** The outline of the spacecraft at the start, which shows how far it has moved since. */
  drawStart() {
    const outline = new THREE.LineBasicMaterial({ transparent: true, opacity: 0.7, depthWrite: false });
    this.bodies[0].children.forEach((mesh) => { // the base is the first body
      const lines = new THREE.LineSegments(mesh.children[0].geometry, outline);
      lines.position.copy(mesh.position);
      lines.quaternion.copy(mesh.quaternion);
      this.startGroup.add(lines);
    });
    this.motion.read(0, 0, this.startGroup.position, this.startGroup.quaternion);
    this.startLines = outline;
  }

  /** Apply the colours of a theme; a ghost, as what is only measured, is translucent and casts no shadow. */
  paint(theme, isGhost) {
    const colours = COLOURS[theme];
    this.painted.forEach(({ role, arm, own, material, lines, mesh }) => {
      const ghost = isGhost || role === "measured";
      const colour = { arm: colours.arms[arm % 4], target: colours.arms[arm % 4], deputy: colours.deputy, measured: colours.deputy }[role];
      material.color.set(role === "own" ? own : colour);
      material.emissive.set(role === "deputy" ? colour : 0x000000);
      material.emissiveIntensity = 0.25;
      material.transparent = ghost;
      material.opacity = ghost ? GHOST_OPACITY : 1;
      material.depthWrite = !ghost;
      material.needsUpdate = true;
      mesh.castShadow = !ghost && role !== "target";
      if (lines) {
        lines.color.set(ghost ? colours.start : colours.edge);
        lines.opacity = ghost ? 0.35 : 0.6;
      }
    });
    this.traces.forEach((trace, arm) => trace.colour(colours.arms[arm % 4]));
    this.basePath.colour(colours.start);
    this.startLines.color.set(colours.start);
    this.startGroup.visible = !isGhost;
    this.nearest?.paint(colours);
    this.momentum?.paint(colours.momentum);
    this.planned.paint(colours);
    [...this.traces, this.basePath].forEach((trace) => {
      trace.past.material.linewidth = isGhost ? TRACE_WIDTH * 0.6 : TRACE_WIDTH;
    });
  }

  /** Add new instants, plans, phases and grasps. */
  extend(data) {
    this.motion.append(data);
    if (data.planned) this.planned.append(data.planned);
    this.data.phases = data.phases;
    this.data.events = data.events;
    [...this.traces, this.basePath].forEach((trace) => trace.rebuild());
  }

  /** Move everything to its pose at time t (s). */
  place(t) {
    this.bodies.forEach((body, index) => {
      body.visible = this.motion.at(t, index, body.position, body.quaternion);
    });
    const index = this.motion.index(t);
    [...this.traces, this.basePath].forEach((trace) => trace.show(index));
    this.nearest?.place(t);
    this.momentum?.place(t);
    this.planned.place(t);
  }

  /** The current position of a body, in m. */
  position(name) { return this.bodies[this.body(name)].position; }

  /** The phase at time t. */
  phase(t) { return this.data.phases.filter((phase) => phase.start <= t + 1e-9).pop(); }
}
