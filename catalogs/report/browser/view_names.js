// Names of openings over the view: which are shown, and where each stands on the screen.
//
// A mine may have hundreds of openings. Those in which rock has failed deepest come first, and no name covers another
// one. view.js draws the view and calls this.

const ViewNames = (function () {
  "use strict";

  const MAX_NAMES = 12; // On each side; more hide the mine.
  const MAX_LETTERS = 26; // Of a name on the screen; the list has the whole name.
  const HEIGHT = 15; // Pixels of a line of text.
  const GAP = 3; // Pixels around a name that stay free at least.
  const DISTANCES = [10, 22, 38, 58]; // Pixels between an opening and a name that does not fit onto it.
  const DIRECTIONS = Array.from({ length: 12 }, (_, i) => [Math.cos(i * Math.PI / 6), -Math.sin(i * Math.PI / 6)]);
  const CLICK_DISTANCE = 4; // Pixels beyond an opening's reach at which a click still finds it.
  const MAX_IN_SENTENCE = 5;

  const shortened = (name) => name.length > MAX_LETTERS ? name.slice(0, MAX_LETTERS - 1) + "…" : name;
  const overlap = (a, b) => a.left < b.right && a.right > b.left && a.top < b.bottom && a.bottom > b.top;

  // Places for names: an iterable of {name, x, y, width}, pixels, the most important first. area: box that holds them
  // all; taken: boxes that none covers. Returns what has room, at most `most`, each with its box and its middle.
  function place(wanted, area, taken, most = MAX_NAMES) {
    const placed = [], boxes = taken.slice(), anchors = [];
    for (const one of wanted) {
      if (placed.length >= most) break;
      if (one.x < area.left || one.x > area.right || one.y < area.top || one.y > area.bottom) continue;
      const halfWidth = one.width / 2 + GAP, halfHeight = HEIGHT / 2 + GAP;
      const middles = [[one.x, one.y]];
      for (const distance of DISTANCES) for (const [x, y] of DIRECTIONS) {
        middles.push([
          one.x + x * distance + Math.max(-1, Math.min(1, 1.5 * x)) * halfWidth,
          one.y + y * distance + Math.max(-1, Math.min(1, 1.5 * y)) * halfHeight,
        ]);
      }
      for (const [x, y] of middles) {
        const box = { left: x - halfWidth, right: x + halfWidth, top: y - halfHeight, bottom: y + halfHeight };
        if (box.left < area.left || box.right > area.right || box.top < area.top || box.bottom > area.bottom) continue;
        // Neither a name nor the dot of another opening that is named is covered.
        if (boxes.some((other) => overlap(box, other)) || anchors.some((other) => overlap(box, other))) continue;
        boxes.push(box);
        anchors.push({ left: one.x, right: one.x, top: one.y, bottom: one.y });
        placed.push({ ...one, box, middle: { x, y } });
        break;
      }
    }
    return placed;
  }

  // The openings of the page's data. depth, side and closure: by opening, then by step.
  class Openings {
    constructor({ openings, sides, measured }, { places, depth, side, closure }, steps) {
      Object.assign(this, { openings, sides, measured, places, depth, side, closure, steps });
      let first = 0;
      this.first = openings.map((one) => (first += one.places) - one.places);
      this.label = openings.map((one) => shortened(one.name));
    }

    depthAt(opening, step) { return this.depth[opening * this.steps.length + step]; }

    isMined(opening, step) { return this.openings[opening].step >= 0 && this.openings[opening].step <= step; }

    // All that is drawn in a step, the deepest failure first, planned ones last; those as deep as listed, the largest
    // first. The chosen one comes before all.
    inOrder(step, chosen) {
      const rank = (opening) => !this.isMined(opening, step) ? -2
        : Number.isNaN(this.depthAt(opening, step)) ? -1 : this.depthAt(opening, step);
      const drawn = this.openings.map((_, i) => i)
        .filter((i) => this.openings[i].step < 0 || this.isMined(i, step) || i === chosen);
      return drawn.sort((a, b) => (b === chosen) - (a === chosen) || rank(b) - rank(a) || a - b);
    }

    // "3.2 m (roof)", or empty where rock has not failed or nothing is known.
    failure(opening, step) {
      const depth = this.depthAt(opening, step);
      if (!this.isMined(opening, step) || !(depth > 0)) return "";
      return `${depth.toFixed(1)} m (${this.sides[this.side[opening * this.steps.length + step]]})`;
    }

    // What is said of one opening after a step.
    reading(opening, step) {
      const { name, step: mined, filled } = this.openings[opening], after = this.steps[step].name;
      if (mined < 0) return `${name}: planned, not mined yet`;
      if (mined > step) return `${name}: mined in step ${this.steps[mined].name}, which comes later`;
      const parts = [`${name}: mined in step ${this.steps[mined].name}`];
      if (filled >= 0) parts.push(`${filled > step ? "to be filled" : "filled"} in step ${this.steps[filled].name}`);
      if (!Number.isNaN(this.depthAt(opening, step))) {
        const failure = this.failure(opening, step), closure = this.closure[opening * this.steps.length + step];
        parts.push(failure ? `after ${after} rock has failed to a depth of ${failure}` : `after ${after} no failed rock`);
        if (!Number.isNaN(closure)) parts.push(`closure ${(1000 * closure).toFixed(0).replace("-", "−")} mm`);
      }
      return parts.join("; ");
    }

    // Which names are shown, and the deepest failure: for readers who do not see the picture, too.
    sentence(shown, step) {
      const order = this.inOrder(step, null), after = this.steps[step].name;
      const deepest = order.filter((opening) => this.failure(opening, step)).slice(0, MAX_IN_SENTENCE);
      const first = !this.measured ? "the largest" : "those in which rock has failed deepest";
      const names = shown.length < order.length
        ? `${shown.length} of ${order.length} openings are named: ${first}, if their names have room.`
        : "All openings are named.";
      const failed = deepest.map((opening) => `${this.openings[opening].name} ${this.failure(opening, step)}`);
      return failed.length ? `${names} Deepest failure after ${after}: ${failed.join(", ")}.` : names;
    }

    // The opening at a place of the screen, or null. screen(x, y, z) gives pixels and depth; metres: of a pixel.
    at(x, y, step, screen, metres) {
      let best = null;
      this.openings.forEach((one, opening) => {
        if (one.step >= 0 && !this.isMined(opening, step)) return;
        for (let i = this.first[opening]; i < this.first[opening] + one.places; i++) {
          const place = screen(this.places[3 * i], this.places[3 * i + 1], this.places[3 * i + 2]);
          const apart = Math.hypot(place.x - x, place.y - y);
          if (apart > one.reach / metres + CLICK_DISTANCE) continue;
          if (!best || apart < best.apart) best = { opening, apart };
        }
      });
      return best && best.opening;
    }
  }

  // The text elements of the names, made once and used again.
  class Labels {
    constructor(svg) {
      this.group = svg.insertBefore(document.createElementNS(svg.namespaceURI, "g"), svg.firstChild);
      this.pool = [];
      this.width = new Map();
    }

    // Pixels that a text takes.
    measure(text) {
      if (!this.width.has(text)) {
        const probe = this.made("text", "view-name");
        probe.textContent = text;
        this.width.set(text, probe.getComputedTextLength());
        probe.remove();
      }
      return this.width.get(text);
    }

    made(name, className) {
      const one = document.createElementNS(this.group.namespaceURI, name);
      one.setAttribute("class", className);
      return this.group.appendChild(one);
    }

    // placed: what `place` returns, with `chosen` where it is.
    draw(placed) {
      while (this.pool.length < placed.length) {
        this.pool.push({ line: this.made("path", "view-name-line"), text: this.made("text", "view-name") });
      }
      this.pool.forEach(({ line, text }, i) => {
        const one = placed[i];
        for (const part of [line, text]) part.setAttribute("visibility", one ? "visible" : "hidden");
        if (!one) return;
        const { box, middle, x, y } = one;
        const endX = Math.max(box.left + GAP, Math.min(box.right - GAP, x));
        const endY = Math.max(box.top + GAP, Math.min(box.bottom - GAP, y));
        const away = middle.x !== x || middle.y !== y;
        line.setAttribute("d", away ? `M${endX},${endY}L${x},${y}m-1.5,0a1.5,1.5 0 1 0 3,0a1.5,1.5 0 1 0 -3,0` : "");
        text.setAttribute("x", middle.x);
        text.setAttribute("y", middle.y + 4);
        text.setAttribute("class", one.chosen ? "view-name view-name-chosen" : "view-name");
        text.textContent = one.name;
      });
    }
  }

  return { Labels, Openings, place };
})();
