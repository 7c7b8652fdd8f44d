// The view of the report that can be turned. It draws what catalogs/report/sections/view.py has put into the page.
//
// One canvas has a side for each catalogue, the modelled one on the left. One camera serves all sides, so they turn
// together. It projects in parallel: all lengths across the line of sight have one scale, which the bar shows.
// Coordinates are those of the mine (x east, y north, z up) in metres, relative to the middle of the view. A picture is
// drawn only after a change. The script asks no address and stores nothing.

(function () {
  "use strict";

  const PICK_DISTANCE = 4; // Pixels beyond an event's symbol at which a click still reads it.
  const CLICK_DISTANCE = 4; // Pixels that the pointer may move in a click; beyond, it turns the view.
  const MAX_SCALE_BAR = 130; // Pixels.
  const ARROW_LENGTH = 30; // Pixels.
  const KEY_TURN = Math.PI / 24;
  const KEY_ZOOM = 0.9;
  const OPACITY = { open: 0.7, planned: 0.2, rock: 0.14 };
  const DIRECTIONS = { // From the middle of the view to the camera.
    oblique: [0.55, -0.75, 0.45],
    plan: [0, -1e-4, 1], // North is up.
    north: [0, -1, 0],
    west: [1, 0, 0],
  };
  const TYPES = { float32: Float32Array, float64: Float64Array, int32: Int32Array };
  const element = (name) => document.getElementById("view-" + name);

  // ---- from the page's data to things to draw ----

  // The numbers of an array as `packed` of sections/view.py makes it.
  async function unpacked({ type, stride, base64 }) {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const inflated = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const array = new TYPES[type](await new Response(inflated).arrayBuffer());
    if (stride) for (let i = stride; i < array.length; i++) array[i] += array[i - stride];
    return array;
  }

  // Closed surfaces, one part for each step, in one mesh that lets what is behind it show through.
  async function meshOf(surface, opacity) {
    const place = await unpacked(surface.vertices);
    const position = Float32Array.from(place, (value, i) => surface.origin[i % 3] + value * surface.unit);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(position.length), 3));
    geometry.setIndex(new THREE.BufferAttribute(Uint32Array.from(await unpacked(surface.triangles)), 1));
    geometry.computeVertexNormals();
    const look = { vertexColors: true, opacity, transparent: true, depthWrite: false, side: THREE.DoubleSide };
    const mesh = new THREE.Mesh(geometry, new THREE.MeshLambertMaterial(look));
    return { mesh, parts: surface.parts };
  }

  // Give each part of a mesh its colour.
  function paint({ mesh, parts }, colourOf) {
    const colours = mesh.geometry.attributes.color, colour = mesh.material.color.clone();
    let vertex = 0;
    for (const part of parts) {
      colour.set(colourOf(part));
      const end = vertex + part.vertices;
      for (; vertex < end; vertex++) colours.setXYZ(vertex, colour.r, colour.g, colour.b);
    }
    colours.needsUpdate = true;
  }

  // Show the parts that are chosen, which follow one another: parts are in the order of steps.
  function show({ mesh, parts }, isShown) {
    let first = 0, count = 0;
    for (const part of parts) {
      if (isShown(part)) count += 3 * part.triangles;
      else if (!count) first += 3 * part.triangles;
    }
    mesh.geometry.setDrawRange(first, count);
    mesh.visible = count > 0;
  }

  // Events are discs of constant size on the screen with a dark rim. They are not shaded, so that their colours are
  // those of the key and of the figures.
  function eventMaterial(pixelRatio) {
    return new THREE.ShaderMaterial({
      uniforms: { ratio: { value: pixelRatio } },
      vertexShader: `
        uniform float ratio;
        attribute float diameter, shown;
        attribute vec3 tint;
        varying vec3 colour;
        varying float pixels;
        void main() {
          colour = tint;
          pixels = diameter * ratio;
          gl_PointSize = pixels;
          gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
          if (shown < 0.5) gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // outside of the picture
        }`,
      fragmentShader: `
        varying vec3 colour;
        varying float pixels;
        void main() {
          float radius = length(2.0 * gl_PointCoord - 1.0);
          if (radius > 1.0) discard;
          gl_FragColor = vec4(radius > 1.0 - 2.5 / pixels ? 0.3 * colour : colour, 1.0);
        }`,
    });
  }

  // The events of one catalogue: their numbers, and `points` to draw.
  async function eventsOf(catalogue, data, material) {
    const names = ["position", "log_potency", "mw", "step", "time"];
    const arrays = await Promise.all(names.map((name) => unpacked(catalogue[name])));
    const events = Object.fromEntries(names.map((name, i) => [name, arrays[i]]));
    const { low, high, smallest, largest } = data.sizes;
    const colours = data.steps.map(({ colour }) => [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16) / 255));
    events.diameter = events.log_potency.map((size) => {
      const share = Number.isNaN(size) ? 0 : Math.min(Math.max((size - low) / (high - low), 0), 1);
      return smallest + (largest - smallest) * share;
    });
    events.shown = new Float32Array(catalogue.count);
    const geometry = new THREE.BufferGeometry();
    const tint = Float32Array.from(Array.from(events.step).flatMap((step) => colours[step]));
    geometry.setAttribute("position", new THREE.BufferAttribute(events.position, 3));
    geometry.setAttribute("tint", new THREE.BufferAttribute(tint, 3));
    geometry.setAttribute("diameter", new THREE.BufferAttribute(events.diameter, 1));
    geometry.setAttribute("shown", new THREE.BufferAttribute(events.shown, 1));
    events.points = new THREE.Points(geometry, material);
    events.points.frustumCulled = false;
    return events;
  }

  // ---- words ----

  const fixed = (value, decimals) => Number.isNaN(value) ? "–" : value.toFixed(decimals).replace("-", "−");
  const counted = (count) => String(count).replace(/\B(?=(\d{3})+$)/g, "\u202f");

  function reading(side, event, data) {
    const { position, log_potency, mw, step, time } = side.events;
    const from = [0, 1, 2].map((axis) => position[3 * event + axis]);
    const place = from.map((part, axis) => fixed(part + data.centre[axis], 1));
    const grid = data.grid && data.grid.rows.map(
      (row, axis) => fixed(data.grid.centre[axis] + row[0] * from[0] + row[1] * from[1] + row[2] * from[2], 1));
    const moment = Number.isNaN(time[event])
      ? "time not known"
      : new Date(1000 * time[event]).toISOString().slice(0, 16).replace("T", " ") + " UTC";
    return [
      `${side.label} event`,
      `step ${data.steps[step[event]].name}`,
      moment + (side.modelled ? " (order within the step, not a date)" : ""),
      `log P ${fixed(log_potency[event], 2)}`,
      `Mw ${fixed(mw[event], 2)}`,
      `x ${place[0]} m, y ${place[1]} m, z ${place[2]} m`,
      ...(grid ? [`in the mine's grid ${grid.join(", ")} ${data.grid.units}`] : []),
    ].join("; ");
  }

  // ---- the view ----

  async function start() {
    const root = element("root"), canvas = element("canvas"), stage = element("stage");
    const context = canvas.getContext("webgl2", { antialias: true });
    if (!context || typeof DecompressionStream === "undefined") return; // The page says what is needed.
    const data = JSON.parse(element("data").textContent);
    const renderer = new THREE.WebGLRenderer({ canvas, context });
    renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    renderer.setClearColor(0xffffff);
    renderer.setScissorTest(true);

    const camera = new THREE.OrthographicCamera(-1, 1, 1, -1, 0, 40 * data.radius);
    camera.up.set(0, 0, 1);
    const scene = new THREE.Scene();
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    camera.add(sun); // It shines over the reader's left shoulder from wherever the view is seen.
    sun.position.set(-0.5, 0.8, 1);
    scene.add(camera, new THREE.AmbientLight(0xffffff, 1.3));

    const planned = await meshOf(data.planned, OPACITY.planned);
    const openings = await meshOf(data.openings, OPACITY.open);
    const rock = await meshOf(data.rock, OPACITY.rock);
    const material = eventMaterial(renderer.getPixelRatio());
    paint(planned, () => data.colours.open);
    paint(rock, ({ step }) => data.steps[step].colour);
    scene.add(planned.mesh, openings.mesh);
    const sides = [];
    for (const catalogue of data.catalogues) {
      const { label, modelled, count, total } = catalogue, group = new THREE.Group();
      const events = await eventsOf(catalogue, data, material);
      group.add(events.points);
      if (modelled) group.add(rock.mesh);
      scene.add(group);
      sides.push({ label, modelled, count, total, events, group, title: element("title-" + sides.length) });
    }

    const names = ["places", "depth", "side", "closure"], numbers = await Promise.all(
      names.map((name) => unpacked(data.names[name])));
    const named = new ViewNames.Openings(
      data.names, Object.fromEntries(names.map((name, i) => [name, numbers[i]])), data.steps);

    root.classList.add("view-on");
    const controls = new THREE.OrbitControls(camera, canvas);
    const overlay = new Overlay(element("overlay")), labels = new ViewNames.Labels(element("overlay"));
    let opening = null; // The chosen one.
    let selected = null, waiting = false, painted = null;

    // ---- what is shown ----

    function choose() {
      const step = Number(element("step").value), least = Number(element("least").value);
      const only = element("only").checked;
      element("step-name").textContent = data.steps[step].name;
      element("least-value").textContent = fixed(least, 1);
      element("step").setAttribute("aria-valuetext", data.steps[step].name);
      const open = element("openings").checked, failed = element("rock").checked;
      show(planned, () => open);
      show(openings, (part) => open && part.step <= step);
      if (step !== painted) {
        paint(openings, ({ filled }) => filled >= 0 && filled <= step ? data.colours.fill : data.colours.open);
        painted = step;
      }
      const within = (its) => only ? its === step : its <= step;
      show(rock, (part) => failed && within(part.step));
      for (const { events, count, total, label, title } of sides) {
        let shown = 0;
        for (let i = 0; i < count; i++) {
          events.shown[i] = within(events.step[i]) && !(events.log_potency[i] < least) ? 1 : 0;
          shown += events.shown[i];
        }
        events.points.geometry.attributes.shown.needsUpdate = true;
        title.textContent = `${label}: ${counted(shown)} of ${counted(total)} events`;
      }
      if (selected && !selected.side.events.shown[selected.event]) select(null);
      readOpening();
      redraw();
    }

    function chooseOpening(found) {
      opening = found;
      element("opening").value = found === null ? "" : named.openings[found].name;
      readOpening();
      redraw();
    }

    function readOpening() {
      element("opening-reading").textContent =
        opening === null ? "No opening is chosen." : named.reading(opening, Number(element("step").value)) + ".";
    }

    function select(found) {
      selected = found;
      root.dataset.picked = found ? `${sides.indexOf(found.side)}:${found.event}` : "";
      element("reading").textContent = found ? reading(found.side, found.event, data) : "No event is chosen.";
      redraw();
    }

    // The events shown, the largest first; those without a size last.
    function bySize() {
      const found = [];
      for (const side of sides) for (let event = 0; event < side.count; event++) {
        if (side.events.shown[event]) found.push({ side, event });
      }
      const size = ({ side, event }) => side.events.log_potency[event];
      return found.sort((a, b) => (Number.isNaN(size(a)) - Number.isNaN(size(b))) || size(b) - size(a));
    }

    function selectNext() {
      const order = bySize();
      const at = order.findIndex(({ side, event }) => selected && side === selected.side && event === selected.event);
      select(order[at + 1] ?? null);
    }

    // ---- where things are on the screen ----

    const across = () => canvas.clientWidth / sides.length;

    // The camera's frame for a picture of so many pixels: the whole view fits, and pixels are square.
    function frame(width) {
      const metres = 2 * data.radius / Math.min(across(), canvas.clientHeight); // of a pixel, before any zoom
      camera.top = metres * canvas.clientHeight / 2;
      camera.right = metres * width / 2;
      camera.bottom = -camera.top;
      camera.left = -camera.right;
      camera.updateProjectionMatrix();
      return metres / camera.zoom;
    }

    // Pixels from the canvas's upper left corner, and how far away (larger is farther), of a place in a side's frame.
    function projected(side, x, y, z) {
      const point = new THREE.Vector3(x, y, z).project(camera), left = sides.indexOf(side) * across();
      return {
        x: left + (point.x + 1) / 2 * across(), y: (1 - point.y) / 2 * canvas.clientHeight, depth: point.z,
      };
    }

    function onScreen(side, event) {
      return projected(side, ...side.events.position.subarray(3 * event, 3 * event + 3));
    }

    const sideAt = (x) => sides[Math.min(Math.floor(x / across()), sides.length - 1)];

    // The opening at a place of the canvas, or null.
    function openingAt(x, y) {
      const metres = frame(across()), side = sideAt(x), step = Number(element("step").value);
      return named.at(x, y, step, (...place) => projected(side, ...place), metres);
    }

    // The event whose symbol is seen at a place of the canvas: the foremost there, or else the nearest close by.
    function eventAt(x, y) {
      const side = sideAt(x);
      let best = null;
      frame(across());
      for (let event = 0; event < side.count; event++) {
        if (!side.events.shown[event]) continue;
        const place = onScreen(side, event);
        const beyond = Math.max(Math.hypot(place.x - x, place.y - y) - side.events.diameter[event] / 2, 0);
        if (beyond > PICK_DISTANCE) continue;
        if (!best || beyond < best.beyond || (beyond === best.beyond && place.depth < best.depth)) {
          best = { side, event, beyond, depth: place.depth };
        }
      }
      return best;
    }

    // ---- drawing ----

    function draw() {
      waiting = false;
      const height = canvas.clientHeight;
      if (!height) return; // In print; the observer of the size asks again afterwards.
      const metres = frame(across());
      sides.forEach((side, i) => {
        for (const other of sides) other.group.visible = other === side;
        renderer.setViewport(i * across(), 0, across(), height);
        renderer.setScissor(i * across(), 0, across(), height);
        renderer.render(scene, camera);
      });
      overlay.draw(camera, metres, height, selected && {
        ...onScreen(selected.side, selected.event), radius: selected.side.events.diameter[selected.event] / 2 + 4,
      });
      drawNames(height);
      frame(canvas.clientWidth); // The controls move the view by pixels of the whole canvas.
      root.dataset.ready = "true";
    }

    // Names of openings on each side, beside its title, and those of the first side beside the scale and the arrows.
    function drawNames(height) {
      const step = Number(element("step").value), order = named.inOrder(step, opening), placed = [];
      const shown = element("names").checked ? order : [];
      let most = [];
      sides.forEach((side, i) => {
        const left = i * across();
        const area = { left: left + 2, right: left + across() - 2, top: 30, bottom: height - 2 };
        const taken = i ? [] : [{ left: 0, right: 150, top: height - 132, bottom: height }];
        const wanted = function* () { // One by one, since most of many are not needed.
          for (const index of shown) {
            const first = 3 * named.first[index], name = named.label[index];
            const { x, y } = projected(side, ...named.places.subarray(first, first + 3));
            yield { name, index, x, y, width: labels.measure(name), chosen: index === opening };
          }
        };
        const own = ViewNames.place(wanted(), area, taken);
        if (own.length > most.length) most = own;
        placed.push(...own);
      });
      labels.draw(placed);
      const text = shown.length ? named.sentence(most.map(({ index }) => index), step) : "";
      if (element("named").textContent !== text) element("named").textContent = text;
    }

    function redraw() {
      if (!waiting) requestAnimationFrame(draw);
      waiting = true;
    }

    function look() {
      controls.target.set(0, 0, 0);
      camera.position.fromArray(DIRECTIONS[element("direction").value]).setLength(20 * data.radius);
      camera.zoom = 1;
      controls.update();
      redraw();
    }

    // ---- what the reader does ----

    for (const name of ["step", "least", "only", "up-to", "openings", "rock", "names"]) {
      element(name).addEventListener("input", choose);
    }
    element("direction").addEventListener("input", look);
    element("opening").addEventListener("input", () => {
      const found = named.openings.findIndex(({ name }) => name === element("opening").value);
      chooseOpening(found < 0 ? null : found);
    });
    element("reset").addEventListener("click", look);
    element("largest").addEventListener("click", () => select(bySize()[0] ?? null));
    element("smaller").addEventListener("click", selectNext);
    controls.addEventListener("change", redraw);
    new ResizeObserver(() => {
      renderer.setSize(stage.clientWidth, stage.clientHeight, false);
      redraw();
    }).observe(stage);

    // The wheel scrolls the page until the view is chosen.
    controls.enableZoom = false;
    canvas.addEventListener("focus", () => { controls.enableZoom = true; });
    canvas.addEventListener("blur", () => { controls.enableZoom = false; });
    let pressed = null;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.focus({ preventScroll: true });
      pressed = event;
    });
    canvas.addEventListener("pointerup", (event) => {
      const moved = pressed ? Math.hypot(event.clientX - pressed.clientX, event.clientY - pressed.clientY) : Infinity;
      const corner = canvas.getBoundingClientRect();
      if (moved <= CLICK_DISTANCE) {
        const place = [event.clientX - corner.left, event.clientY - corner.top], found = eventAt(...place);
        select(found);
        if (!found) chooseOpening(openingAt(...place));
      }
      pressed = null;
    });
    const KEYS = {
      ArrowLeft: () => controls.rotateLeft(KEY_TURN),
      ArrowRight: () => controls.rotateLeft(-KEY_TURN),
      ArrowUp: () => controls.rotateUp(KEY_TURN),
      ArrowDown: () => controls.rotateUp(-KEY_TURN),
      "+": () => controls.dollyIn(KEY_ZOOM),
      "-": () => controls.dollyOut(KEY_ZOOM),
      Home: look,
    };
    canvas.addEventListener("keydown", (event) => {
      if (!KEYS[event.key] || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      KEYS[event.key]();
    });

    renderer.setSize(stage.clientWidth, stage.clientHeight, false);
    look();
    choose();
  }

  // Over the canvas: the scale, the arrows for east, north and up, and a ring around the event that is read.
  class Overlay {
    constructor(svg) {
      this.svg = svg;
      this.scale = this.add("path", "view-scale");
      this.length = this.add("text", "view-length");
      this.ring = this.add("circle", "view-ring");
      this.axes = ["E", "N", "up"].map((name) => {
        const arrow = this.add("path", "view-arrow"), label = this.add("text", "view-axis");
        label.textContent = name;
        return { arrow, label };
      });
    }

    add(name, className) {
      const made = document.createElementNS("http://www.w3.org/2000/svg", name);
      made.setAttribute("class", className);
      return this.svg.appendChild(made);
    }

    // metres: of one pixel; ring: its centre and radius in pixels, or null.
    draw(camera, metres, height, ring) {
      const power = 10 ** Math.floor(Math.log10(MAX_SCALE_BAR * metres));
      const length = Math.max(...[1, 2, 5].map((times) => times * power).filter((m) => m <= MAX_SCALE_BAR * metres));
      this.scale.setAttribute("d", `M14,${height - 20}v6h${length / metres}v-6`);
      this.length.setAttribute("x", 14 + length / metres / 2);
      this.length.setAttribute("y", height - 20);
      this.length.textContent = `${Number(length.toPrecision(1))} m`;
      const toCamera = camera.quaternion.clone().invert();
      this.axes.forEach(({ arrow, label }, axis) => {
        const { x, y } = new THREE.Vector3().setComponent(axis, 1).applyQuaternion(toCamera);
        const long = Math.hypot(x, y), [left, top] = [54, height - 84];
        const [endX, endY] = [left + ARROW_LENGTH * x, top - ARROW_LENGTH * y];
        // The head is two strokes that turn with the arrow; an arrow along the line of sight is not drawn.
        const [alongX, alongY] = [6 * x / long, -6 * y / long];
        const head = `M${endX - alongX - alongY / 2},${endY - alongY + alongX / 2}L${endX},${endY}`
          + `L${endX - alongX + alongY / 2},${endY - alongY - alongX / 2}`;
        const visible = long > 0.2;
        arrow.setAttribute("d", visible ? `M${left},${top}L${endX},${endY}${head}` : "");
        label.setAttribute("x", left + (ARROW_LENGTH + 11) * x);
        label.setAttribute("y", top - (ARROW_LENGTH + 11) * y + 4);
        label.setAttribute("visibility", visible ? "visible" : "hidden");
      });
      this.ring.setAttribute("visibility", ring ? "visible" : "hidden");
      if (ring) for (const [name, value] of [["cx", ring.x], ["cy", ring.y], ["r", ring.radius]]) {
        this.ring.setAttribute(name, value);
      }
    }
  }

  start();
})();
