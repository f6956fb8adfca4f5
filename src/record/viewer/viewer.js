// Draws an animated .glb of ours: turned with the mouse, scrubbed along time. WebGL 2 alone, nothing is loaded.
//
// It reads what src/record/glb.rs writes: one buffer, TRS nodes, LINEAR and STEP channels, triangles and line strips, colours and
// textures. The address may say where to begin and what to show: #t=12.5

"use strict";
(function () {
  const root = document.getElementById("replay");
  const canvas = root.querySelector("canvas");
  const [play, slider, clock, speed, caption, notice] =
    ["play", "time", "clock", "speed", "caption", "notice"].map((name) => root.querySelector("." + name));
  const gl = canvas.getContext("webgl2", { antialias: true });
  if (!gl) {
    notice.textContent = "This browser has no WebGL 2: open record/replay.glb in Blender or another viewer of glTF.";
    return;
  }

  // --- the file -------------------------------------------------------------------------------------------------------
  const text = atob(document.getElementById("glb").textContent.trim());
  const file = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) file[i] = text.charCodeAt(i);
  const view = new DataView(file.buffer);
  const jsonLength = view.getUint32(12, true);
  const gltf = JSON.parse(new TextDecoder().decode(file.subarray(20, 20 + jsonLength)));
  const blob = 20 + jsonLength + 8;
  const KINDS = { 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array };
  const WIDTHS = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 };

  function bytes(index) {
    const { byteOffset, byteLength } = gltf.bufferViews[index];
    return file.subarray(blob + byteOffset, blob + byteOffset + byteLength);
  }

  function numbers(index) {
    const accessor = gltf.accessors[index];
    const kind = KINDS[accessor.componentType];
    const raw = bytes(accessor.bufferView);
    // A copy, because a view must begin at a multiple of its size.
    return new kind(raw.slice().buffer, 0, accessor.count * WIDTHS[accessor.type]);
  }

  // --- matrices, by columns -------------------------------------------------------------------------------------------
  function multiply(a, b) {
    const out = new Float32Array(16);
    for (let c = 0; c < 4; c++)
      for (let r = 0; r < 4; r++) {
        let sum = 0;
        for (let k = 0; k < 4; k++) sum += a[k * 4 + r] * b[c * 4 + k];
        out[c * 4 + r] = sum;
      }
    return out;
  }

  function composed([x, y, z], [i, j, k, w], [sx, sy, sz]) {
    return new Float32Array([
      (1 - 2 * (j * j + k * k)) * sx, 2 * (i * j + k * w) * sx, 2 * (i * k - j * w) * sx, 0,
      2 * (i * j - k * w) * sy, (1 - 2 * (i * i + k * k)) * sy, 2 * (j * k + i * w) * sy, 0,
      2 * (i * k + j * w) * sz, 2 * (j * k - i * w) * sz, (1 - 2 * (i * i + j * j)) * sz, 0,
      x, y, z, 1,
    ]);
  }

  const minus = (a, b) => a.map((v, i) => v - b[i]);
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const unit = (a) => { const n = Math.hypot(...a) || 1; return a.map((v) => v / n); };

  function lookAt(eye, target) {
    const back = unit(minus(eye, target));
    const right = unit(cross([0, 1, 0], back));
    const up = cross(back, right);
    return new Float32Array([
      right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
      -dot(right, eye), -dot(up, eye), -dot(back, eye), 1,
    ]);
  }

  function perspective(fovy, aspect, near, far) {
    const f = 1 / Math.tan(fovy / 2);
    return new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0]);
  }

  // --- what is drawn --------------------------------------------------------------------------------------------------
  function shader(kind, source) {
    const made = gl.createShader(kind);
    gl.shaderSource(made, "#version 300 es\nprecision highp float;\n" + source);
    gl.compileShader(made);
    if (!gl.getShaderParameter(made, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(made));
    return made;
  }

  const program = gl.createProgram();
  gl.attachShader(program, shader(gl.VERTEX_SHADER, `
    in vec3 position; in vec3 normal; in vec2 uv; in vec4 color;
    uniform mat4 model; uniform mat4 viewed;
    out vec3 n; out vec3 at; out vec2 st; out vec4 tint;
    void main() {
      vec4 world = model * vec4(position, 1.0);
      n = mat3(model) * normal; at = world.xyz; st = uv; tint = color;
      gl_Position = viewed * world; gl_PointSize = 4.0;
    }`));
  gl.attachShader(program, shader(gl.FRAGMENT_SHADER, `
    in vec3 n; in vec3 at; in vec2 st; in vec4 tint;
    uniform vec4 base; uniform float metal; uniform float lit; uniform float textured; uniform sampler2D picture; uniform vec3 eye;
    out vec4 shown;
    void main() {
      vec4 c = base * tint;
      if (textured > 0.5) c.rgb *= pow(texture(picture, st).rgb, vec3(2.2));
      if (lit > 0.5) {
        vec3 m = normalize(n), v = normalize(eye - at), l = normalize(vec3(0.35, 1.0, 0.25));
        float sky = 0.5 + 0.5 * m.y, sun = max(dot(m, l), 0.0), head = max(dot(m, v), 0.0);
        float gloss = pow(max(dot(m, normalize(l + v)), 0.0), 40.0) * mix(0.06, 0.5, metal);
        c.rgb = c.rgb * (0.30 + 0.30 * sky + 0.55 * sun + 0.15 * head) + gloss;
      }
      shown = vec4(pow(min(c.rgb, vec3(1.0)), vec3(1.0 / 2.2)), c.a);
    }`));
  ["position", "normal", "uv", "color"].forEach((name, i) => gl.bindAttribLocation(program, i, name));
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  const uniform = {};
  for (const name of ["model", "viewed", "base", "metal", "lit", "textured", "picture", "eye"])
    uniform[name] = gl.getUniformLocation(program, name);

  function vertices(list, indices) {
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    list.forEach(([slot, values, width, normalized], i) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(slot);
      gl.vertexAttribPointer(slot, width, values instanceof Float32Array ? gl.FLOAT : gl.UNSIGNED_SHORT, !!normalized, 0, 0);
    });
    if (indices) {
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
    }
    return array;
  }

  const textures = (gltf.textures || []).map(({ source }) => {
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array([200, 200, 200, 255]));
    const image = gltf.images[source];
    createImageBitmap(new Blob([bytes(image.bufferView)], { type: image.mimeType })).then((bitmap) => {
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
      gl.generateMipmap(gl.TEXTURE_2D);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
      draw();
    });
    return texture;
  });

  const SLOTS = { POSITION: [0, 3], NORMAL: [1, 3], TEXCOORD_0: [2, 2], COLOR_0: [3, 4] };
  const meshes = gltf.meshes.map((mesh) => mesh.primitives.map((primitive) => {
    const list = Object.entries(primitive.attributes).map(([name, index]) => [SLOTS[name][0], numbers(index), SLOTS[name][1], name === "COLOR_0"]);
    const indices = primitive.indices === undefined ? null : numbers(primitive.indices);
    const material = gltf.materials[primitive.material];
    const surface = material.pbrMetallicRoughness;
    return {
      array: vertices(list, indices),
      colored: "COLOR_0" in primitive.attributes,
      count: indices ? indices.length : gltf.accessors[primitive.attributes.POSITION].count,
      strip: primitive.mode === 3,
      base: surface.baseColorFactor,
      metal: surface.metallicFactor,
      clear: material.alphaMode === "BLEND",
      texture: surface.baseColorTexture ? textures[surface.baseColorTexture.index] : null,
    };
  }));

  // An arrow along x, one metre long, for contacts.
  const arrow = (function () {
    const at = [], n = [];
    const ring = (x, r, k) => { const a = (k * Math.PI) / 4; return [x, r * Math.cos(a), r * Math.sin(a)]; };
    for (let k = 0; k < 8; k++) {
      const out = ring(0, 1, k + 0.5);
      for (const [x0, r0, x1, r1] of [[0, 0.03, 0.75, 0.03], [0.75, 0.09, 1, 0]])
        for (const p of [ring(x0, r0, k), ring(x0, r0, k + 1), ring(x1, r1, k), ring(x1, r1, k), ring(x0, r0, k + 1), ring(x1, r1, k + 1)]) {
          at.push(...p);
          n.push(...out);
        }
    }
    return { array: vertices([[0, new Float32Array(at), 3], [1, new Float32Array(n), 3]]), count: at.length / 3 };
  })();

  // --- time -----------------------------------------------------------------------------------------------------------
  const channels = ((gltf.animations || [])[0] || { channels: [] }).channels.map(({ sampler, target }) => {
    const { input, output, interpolation } = gltf.animations[0].samplers[sampler];
    return { node: target.node, path: target.path, times: numbers(input), values: numbers(output), step: interpolation === "STEP" };
  });
  const end = channels.reduce((most, { times }) => Math.max(most, times[times.length - 1]), 0);
  const extras = Object.assign({ contacts: [], captions: [], steps: [] }, gltf.scenes[0].extras);

  /// How many of the sorted times are at or before t.
  function before(count, time, t) {
    let low = 0, high = count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (time(middle) <= t) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  function pose(t) {
    const nodes = gltf.nodes.map((node) => ({
      translation: node.translation || [0, 0, 0], rotation: node.rotation || [0, 0, 0, 1], scale: node.scale || [1, 1, 1],
    }));
    for (const { node, path, times, values, step } of channels) {
      const width = path === "rotation" ? 4 : 3;
      const next = before(times.length, (i) => times[i], t);
      const a = Math.max(next - 1, 0), b = Math.min(next, times.length - 1);
      const share = step || times[b] <= times[a] ? 0 : (t - times[a]) / (times[b] - times[a]);
      const mixed = Array.from({ length: width }, (_, k) => values[a * width + k] * (1 - share) + values[b * width + k] * share);
      nodes[node][path] = path === "rotation" ? unit(mixed) : mixed;
    }
    const world = [];
    (function place(index, parent) {
      const { translation, rotation, scale } = nodes[index];
      world[index] = multiply(parent, composed(translation, rotation, scale));
      for (const child of gltf.nodes[index].children || []) place(child, world[index]);
    })(gltf.scenes[0].nodes[0], new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]));
    return { world, hidden: nodes.map(({ scale }) => scale[0] === 0) };
  }

  // --- the picture ----------------------------------------------------------------------------------------------------
  // From z up to y up.
  const yUp = ([x, y, z]) => [x, z, -y];
  const start = extras.view ? extras.view.map(yUp) : [[2, 1.6, 0], [0.6, 0.8, 0]];
  let target = start[1];
  let [azimuth, height, distance] = (function () {
    const [x, y, z] = minus(start[0], start[1]);
    return [Math.atan2(z, x), Math.atan2(y, Math.hypot(x, z)), Math.hypot(x, y, z)];
  })();
  let now = 0, playing = false;
  const shows = (name) => root.querySelector("." + name).checked;

  function draw() {
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round(canvas.clientHeight * ratio);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.86, 0.88, 0.91, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.useProgram(program);
    const flat = Math.cos(height) * distance;
    const eye = [target[0] + flat * Math.cos(azimuth), target[1] + distance * Math.sin(height), target[2] + flat * Math.sin(azimuth)];
    const seen = multiply(perspective(0.7, canvas.width / canvas.height, 0.02, 30), lookAt(eye, target));
    gl.uniformMatrix4fv(uniform.viewed, false, seen);
    gl.uniform3fv(uniform.eye, eye);
    const { world, hidden } = pose(now);
    const skipped = (name) => (/^estimate\//.test(name) && !shows("ghosts")) || (/^plan\//.test(name) && !shows("plans"));
    const shown = [];
    gltf.nodes[gltf.scenes[0].nodes[0]].children.forEach((body) => {
      const { name, mesh, children } = gltf.nodes[body];
      if (hidden[body] || skipped(name)) return;
      if (mesh !== undefined) shown.push([mesh, world[body]]);
      (children || []).forEach((child) => shown.push([gltf.nodes[child].mesh, world[child]]));
    });
    for (const clear of [false, true]) {
      clear ? gl.enable(gl.BLEND) : gl.disable(gl.BLEND);
      gl.depthMask(!clear);
      for (const [mesh, matrix] of shown) for (const part of meshes[mesh]) if (part.clear === clear) paint(part, matrix);
    }
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    if (shows("contacts")) arrows(world[gltf.scenes[0].nodes[0]]);
    tell();
  }

  function paint(part, matrix) {
    gl.uniformMatrix4fv(uniform.model, false, matrix);
    gl.uniform4fv(uniform.base, part.base);
    gl.uniform1f(uniform.metal, part.metal || 0);
    gl.uniform1f(uniform.lit, part.strip ? 0 : 1);
    gl.uniform1f(uniform.textured, part.texture ? 1 : 0);
    if (part.texture) gl.bindTexture(gl.TEXTURE_2D, part.texture);
    gl.bindVertexArray(part.array);
    if (!part.colored) gl.vertexAttrib4f(3, 1, 1, 1, 1);
    if (part.strip) {
      gl.drawArrays(gl.LINE_STRIP, 0, part.count);
      gl.drawArrays(gl.POINTS, 0, part.count);
    } else if (part.indexed !== false) gl.drawElements(gl.TRIANGLES, part.count, gl.UNSIGNED_INT, 0);
    else gl.drawArrays(gl.TRIANGLES, 0, part.count);
  }

  /// Contacts of the last twentieth of a second, a newton as two millimetres, at most 15 cm.
  function arrows(up) {
    const time = (i) => extras.contacts[i][0];
    const last = before(extras.contacts.length, time, now + 1e-3);
    for (let i = last - 1; i >= 0 && time(i) > now - 0.075; i--) {
      const [, x, y, z, fx, fy, fz] = extras.contacts[i];
      const newtons = Math.hypot(fx, fy, fz);
      if (newtons < 0.2) continue;
      const length = Math.min(0.02 + 0.002 * newtons, 0.15);
      const a = unit([fx, fy, fz]);
      const b = unit(cross(Math.abs(a[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0], a)), c = cross(a, b);
      // The tip is where it presses.
      const from = [x, y, z].map((v, k) => v - a[k] * length);
      const matrix = new Float32Array([
        ...a.map((v) => v * length), 0, ...b.map((v) => v * 0.15), 0, ...c.map((v) => v * 0.15), 0, ...from, 1,
      ]);
      paint({ ...arrow, base: [0.85, 0.08, 0.05, 1], indexed: false }, multiply(up, matrix));
    }
  }

  function tell() {
    slider.value = now;
    clock.textContent = `${now.toFixed(1)} of ${end.toFixed(1)} s`;
    const said = extras.captions[before(extras.captions.length, (i) => extras.captions[i][0], now) - 1];
    const step = extras.steps.find(([from, to]) => from <= now && now < to);
    caption.textContent = [said && said[1], step && step[2].replace("_", " ")].filter(Boolean).join(" – ");
  }

  // --- by hand --------------------------------------------------------------------------------------------------------
  function seek(t) {
    now = Math.min(Math.max(t, 0), end);
    draw();
  }
  slider.max = end;
  slider.addEventListener("input", () => { playing = false; play.textContent = "play"; seek(Number(slider.value)); });
  play.addEventListener("click", () => {
    playing = !playing;
    play.textContent = playing ? "pause" : "play";
    if (playing && now >= end) now = 0;
    let last = performance.now();
    (function frame(time) {
      if (!playing) return;
      seek(now + (Math.max(time - last, 0) / 1000) * Number(speed.value));
      last = time;
      if (now >= end) { playing = false; play.textContent = "play"; } else requestAnimationFrame(frame);
    })(last);
  });
  for (const name of ["ghosts", "plans", "contacts"]) root.querySelector("." + name).addEventListener("change", draw);
  const held = new Map();
  canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); held.set(event.pointerId, event); });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => held.delete(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    const last = held.get(event.pointerId);
    if (!last) return;
    const [dx, dy] = [event.clientX - last.clientX, event.clientY - last.clientY];
    held.set(event.pointerId, event);
    if (event.buttons === 2 || event.shiftKey || held.size > 1) {
      const share = distance / canvas.clientHeight / held.size;
      const right = [-Math.sin(azimuth), 0, Math.cos(azimuth)];
      target = target.map((v, k) => v + right[k] * dx * share + (k === 1 ? dy * share : 0));
    } else {
      azimuth += dx * 0.008;
      height = Math.min(Math.max(height + dy * 0.008, -0.3), 1.55);
    }
    draw();
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    distance = Math.min(Math.max(distance * Math.exp(event.deltaY * 0.001), 0.15), 8);
    draw();
  }, { passive: false });
  window.addEventListener("resize", draw);
  const moment = /[#&]t=([\d.]+)/.exec(location.hash);
  seek(moment ? Number(moment[1]) : 0);
})();
