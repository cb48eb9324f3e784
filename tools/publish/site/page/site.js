// Search on the list, and the viewer in its frame on an object's page. Both pages work without.
'use strict';
const plain = (text) => text.normalize('NFD').replace(/\p{M}/gu, '').toLowerCase();

const box = document.getElementById('search');
if (box) {
  const count = document.getElementById('count');
  const cards = [...document.querySelectorAll('#objects > li')].map((item) => ({ item, words: plain(item.dataset.words), facets: new Set(JSON.parse(item.dataset.facets)) }));
  const whole = count.textContent;
  const facets = [...document.querySelectorAll('[data-facet]')];
  const search = () => {
    const wanted = plain(box.value).split(/\s+/).filter(Boolean);
    const chosen = facets.filter((f) => f.value).map((f) => `${f.dataset.facet}=${f.value}`);
    let shown = 0;
    for (const { item, words, facets: own } of cards) {
      item.hidden = !wanted.every((word) => words.includes(word)) || !chosen.every((choice) => own.has(choice));
      if (!item.hidden) shown += 1;
    }
    count.textContent = wanted.length || chosen.length ? `${shown} ${count.dataset.of} ${whole}` : whole;
  };
  const store = () => {
    // A page from a file has no address of its own to change.
    if (location.protocol !== 'file:') history.replaceState(null, '', box.value ? `?q=${encodeURIComponent(box.value)}` : location.pathname);
  };
  box.value = new URLSearchParams(location.search).get('q') ?? box.value;
  box.addEventListener('input', () => { search(); store(); });
  for (const facet of facets) facet.addEventListener('change', search);
  if (box.value) search();
}

const show = document.getElementById('show');
show?.addEventListener('click', (event) => {
  if (event.ctrlKey || event.metaKey || event.shiftKey || location.protocol === 'file:') return;
  event.preventDefault();
  const frame = document.createElement('iframe');
  frame.title = show.parentElement.dataset.title;
  frame.allow = 'fullscreen';
  frame.src = show.href;
  show.replaceWith(frame);
  frame.focus();
});
