"use strict";
// Who is where, and the switch that stops recruiting; asks again every few seconds.

const EVERY_MS = 3000;
const by = (id) => document.getElementById(id);

function table(rows, states) {
  const named = (name) => name.replaceAll("_", " ");
  const cells = (kind, values) => {
    const row = document.createElement("tr");
    row.append(...values.map((value) => Object.assign(document.createElement(kind), { textContent: value })));
    return row;
  };
  const last = (counts) => Object.entries(counts).sort().map(([page, count]) => `${page || "begun"}: ${count}`).join(", ");
  const body = rows.map((row) => cells("td", [row.arms.map(named).join(", then "), ...states.map((name) => row.states[name]), last(row.last_page)]));
  const one = document.createElement("table");
  one.append(cells("th", ["arm", ...states.map(named), "answered last, of those under way"]), ...body);
  return one;
}

function show(state) {
  const held = state.people.reduce((sum, row) => sum + row.states.finished + row.states.under_way, 0);
  by("title").textContent = document.title = state.title;
  by("recruiting").textContent = `${state.recruiting ? "Recruiting" : "Stopped: nobody new is let in"}. ${held} of ${state.quota} places are taken.`;
  by("protocol").textContent = `Protocol ${state.protocol}`;
  for (const group of ["people", "pilots"]) by(group).replaceChildren(table(state[group], state.states));
  Object.assign(by("switch"), { hidden: false, textContent: state.recruiting ? "Stop recruiting" : "Resume recruiting" });
  by("switch").onclick = async () => {
    const body = JSON.stringify({ recruiting: !state.recruiting });
    show(await (await fetch("/recruiting", { method: "POST", body })).json());
  };
}

async function refresh() {
  try {
    show(await (await fetch("/state")).json());
  } catch {
    by("recruiting").textContent = "The server does not answer.";
  }
  setTimeout(refresh, EVERY_MS);
}

refresh();
