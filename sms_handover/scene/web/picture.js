"use strict";
/* The picture of one or several runs: light, camera, views side by side or one over the other. */

const VIEWS = { // direction from the middle of what is shown to the camera, in world axes
  arms: [0.8, -0.44, 0.4], whole: [0.72, -0.55, 0.5], front: [1, 0, 0.02], side: [0.02, -1, 0.02], top: [-0.02, 0, 1],
};
const FIELD_OF_VIEW = 32; // degrees, vertical

class Picture {
  constructor(canvas, runs) {
    this.canvas = canvas;
    this.runs = runs;
    this.theme = "light";
    this.shown = [[runs[0]]]; // tiles, each a list of runs: the first is solid, the others are ghosts
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.shadowMap.enabled = true;
    this.renderer.setScissorTest(true);
    this.scene = new THREE.Scene();
    runs.forEach((run) => this.scene.add(run.group));
    this.light();
    this.stars = this.makeStars();
    this.camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1, 0.05, 200);
    this.camera.up.set(0, 0, 1);
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.ask());
    this.look("arms");
    new ResizeObserver(() => this.ask()).observe(canvas);
  }

  light() {
    this.sky = new THREE.HemisphereLight(0xffffff, 0x8793a8, 1.5);
    this.sky.position.set(0, 0, 1);
    this.sun = new THREE.DirectionalLight(0xffffff, 2.4);
    this.sun.position.set(4, -2.2, 4.5);
    this.sun.target.position.set(0.6, 0, 0.1);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(2048, 2048);
    this.sun.shadow.bias = -0.0004;
    this.sun.shadow.normalBias = 0.01;
    Object.assign(this.sun.shadow.camera, { left: -3, right: 3, top: 3, bottom: -3, near: 1, far: 14 });
    this.fill = new THREE.DirectionalLight(0xbcd2ff, 0.7);
    this.fill.position.set(1, 4, -1.5);
    this.scene.add(this.sky, this.sun, this.sun.target, this.fill);
  }

  makeStars() {
    const points = [];
    let seed = 12345; // the same sky every time
    const random = () => { seed = (seed * 1103515245 + 12345) % 2147483648; return seed / 2147483648; };
    for (let i = 0; i < 500; i += 1) {
      const z = 2 * random() - 1;
      const turn = 2 * Math.PI * random();
      const across = Math.sqrt(1 - z * z);
      points.push(90 * across * Math.cos(turn), 90 * across * Math.sin(turn), 90 * z);
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(points), 3));
    const material = new THREE.PointsMaterial({ color: 0xc9d8f2, size: 1.4, sizeAttenuation: false, transparent: true, opacity: 0.55 });
    const stars = new THREE.Points(geometry, material);
    this.scene.add(stars);
    return stars;
  }

  /** What a view has to show: the middle and the radius of a ball, in m. */
  subject(view) {
    const box = new THREE.Box3();
    const point = new THREE.Vector3();
    this.runs.forEach((run) => {
      run.data.arms.forEach((arm) => {
        const { points } = run.motion.path(run.body(`${arm}_tool`));
        for (let i = 0; i < points.length; i += 3) box.expandByPoint(point.fromArray(points, i));
        box.expandByPoint(run.position(`${arm}_mount`));
      });
      box.expandByPoint(run.position("deputy"));
      if (view !== "arms") run.bodies[0].children.forEach((mesh) => box.expandByObject(mesh));
    });
    const ball = box.getBoundingSphere(new THREE.Sphere());
    return { middle: ball.center, radius: ball.radius * (view === "arms" ? 0.92 : 0.72) };
  }

  /** Take one of the ready views. */
  look(view) {
    const { middle, radius } = this.subject(view);
    const { width, height } = this.tile();
    const half = (FIELD_OF_VIEW / 2) * (Math.PI / 180);
    const narrow = Math.min(half, Math.atan(Math.tan(half) * (width / height)));
    const direction = new THREE.Vector3(...VIEWS[view]).normalize();
    const room = width < height ? 1.1 : 1; // upright, a ball that just fits hides the elbows
    this.camera.position.copy(middle).addScaledVector(direction, (room * radius) / Math.sin(narrow));
    this.controls.target.copy(middle);
    this.controls.update();
    this.ask();
  }

  paint(theme) {
    this.theme = theme;
    this.paintRuns();
    this.stars.visible = theme === "dark";
    this.sky.intensity = theme === "dark" ? 1.0 : 1.7;
    this.sun.intensity = theme === "dark" ? 2.9 : 2.3;
    this.ask();
  }

  /** Say which runs stand in which tile. */
  arrange(tiles) {
    this.shown = tiles;
    this.paintRuns();
    this.ask();
  }

  /** Give every run its colours: the first of a tile is solid, the others are ghosts. */
  paintRuns() {
    this.shown.forEach((tile) => tile.forEach((run) => run.paint(this.theme, run !== tile[0])));
  }

  /** How the tiles divide the canvas: beside each other, or one above the other where it is narrow. */
  tile() {
    const width = this.canvas.clientWidth || 1;
    const height = this.canvas.clientHeight || 1;
    const count = this.shown.length;
    return width >= height
      ? { width: width / count, height, right: width / count, down: 0 }
      : { width, height: height / count, right: 0, down: height / count };
  }

  /** Draw at the next occasion; many wishes make one picture. */
  ask() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => { this.asked = false; this.draw(); });
  }

  draw() {
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth || !clientHeight) return;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const size = this.renderer.getSize(new THREE.Vector2());
    if (size.x !== clientWidth || size.y !== clientHeight || this.renderer.getPixelRatio() !== ratio) {
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(clientWidth, clientHeight, false);
    }
    const { width, height, right, down } = this.tile();
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.shown.forEach((tile, place) => {
      this.runs.forEach((run) => { run.group.visible = tile.includes(run); });
      const top = clientHeight - height - down * place;
      this.renderer.setViewport(right * place, top, width, height);
      this.renderer.setScissor(right * place, top, width, height);
      this.renderer.render(this.scene, this.camera);
    });
    this.drawn?.();
  }

  /** Where a point lies in a tile, in px from the top left of the canvas; null behind the camera. */
  project(point, place) {
    const { width, height, right, down } = this.tile();
    const seen = point.clone().project(this.camera);
    if (seen.z > 1) return null;
    return { x: right * place + ((seen.x + 1) / 2) * width, y: down * place + ((1 - seen.y) / 2) * height };
  }
}
