// Search over PAGES (sections and rows of tables) with the words of users (SYNONYMS), both written by
// tools/site_search.py. All texts are here, so that a page opened from a file has its excerpts too.
"use strict";

const words = text => text.toLowerCase().normalize("NFKD").match(/[a-z0-9_%]+/g) || [];
const stem = word => word.length > 4 ? word.replace(/(ies|ing|ed|es|s|y)$/, "") : word;

// The query itself, and the same in the words of the glossary.
function readings(query) {
  const plain = words(query).join(" ");
  const found = [{ terms: words(plain), weight: 1 }];
  for (const names of SYNONYMS) {
    for (const name of names) {
      const said = words(name).join(" ");
      if (!(" " + plain + " ").includes(" " + said + " ")) continue;
      for (const other of names) {
        if (other === name) continue;
        const terms = words(plain.replace(said, words(other).join(" ")));
        found.push({ terms, weight: 0.6 });
      }
    }
  }
  return found;
}

function score(entry, terms) {
  let total = 0;
  for (const term of terms) {
    const root = stem(term);
    if (entry.name === term) total += 60;
    else if (entry.head.some(word => word === term)) total += 20;
    else if (entry.head.some(word => word.startsWith(root))) total += 12;
    else if (entry.body.has(term)) total += 4;
    else if ([...entry.body].some(word => word.startsWith(root))) total += 2;
    else return 0;
  }
  // The phrase as it was typed is worth more than its words far apart.
  const phrase = terms.join(" ");
  if (terms.length > 1 && entry.plain.includes(phrase)) total += 25;
  return total;
}

function excerpt(text, terms) {
  const low = text.toLowerCase();
  const place = terms.map(term => low.indexOf(stem(term))).filter(k => k >= 0);
  const first = Math.max(0, (place.length ? Math.min(...place) : 0) - 60);
  const cut = text.slice(first, first + 240);
  const shown = document.createElement("p");
  shown.className = "excerpt";
  const marked = new RegExp("(" + terms.map(t => stem(t).replace(/[^a-z0-9_]/g, ".")).join("|") + ")", "gi");
  shown.append(first ? "… " : "");
  cut.split(marked).forEach((part, k) => {
    if (k % 2) { const mark = document.createElement("mark"); mark.textContent = part; shown.append(mark); }
    else shown.append(part);
  });
  shown.append(first + 240 < text.length ? " …" : "");
  return shown;
}

function find(query) {
  const best = new Map();
  for (const { terms, weight } of readings(query)) {
    if (!terms.length) continue;
    PAGES.forEach((entry, k) => {
      const value = weight * score(entry, terms);
      if (value > 0 && (!best.has(k) || best.get(k).value < value)) best.set(k, { value, terms });
    });
  }
  return [...best].sort((a, b) => b[1].value - a[1].value || a[0] - b[0]).slice(0, 60);
}

for (const entry of PAGES) {
  entry.head = words(entry.title);
  entry.name = entry.head.join(" ");
  entry.plain = words(entry.title + " " + entry.text).join(" ");
  entry.body = new Set(entry.plain.split(" "));
}
const query = new URLSearchParams(location.search).get("q") || "";
document.querySelector("form.find input").value = query;
if (query) {
  const found = find(query);
  document.getElementById("how-many").textContent =
    found.length ? `${found.length === 60 ? "The first 60" : found.length} places` : "Nothing found.";
  for (const [k, { terms }] of found) {
    const item = document.createElement("li"), link = document.createElement("a"), where = document.createElement("span");
    link.href = PAGES[k].url;
    link.textContent = PAGES[k].title;
    where.className = "where";
    where.textContent = " " + PAGES[k].page;
    item.append(link, where, excerpt(PAGES[k].text, terms));
    document.getElementById("found").append(item);
  }
}
