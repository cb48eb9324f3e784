/** What notes and measuring say; an application may add languages to `noteWords`. */
export interface NoteWords {
  notes: string;
  tour: string;
  stop: string;
  close: string;
  next: string;
  before: string;
  measure: string;
  measureHelp: string;
  clear: string;
  add: string;
  addHelp: string;
  title: string;
  text: string;
  remove: string;
  save: string;
  image: string;
  ar: string;
}
/** Words by language. */
export const noteWords: Record<string, NoteWords> = {
  en: { notes: 'Notes', tour: 'Tour', stop: 'End the tour', close: 'Close', next: 'Next', before: 'Back',
    measure: 'Measure',
    measureHelp: 'Click on points of the object, or press Enter for the one in the middle.',
    clear: 'Clear', add: 'Add notes', addHelp: 'Click where the note belongs, or press Enter for the middle.',
    title: 'Title', text: 'Text', remove: 'Remove', save: 'Save as a file', image: 'Picture',
    ar: 'View in your room' },
  de: { notes: 'Notizen', tour: 'Rundgang', stop: 'Rundgang beenden', close: 'Schließen', next: 'Weiter',
    before: 'Zurück', measure: 'Messen',
    measureHelp: 'Klicken Sie auf Punkte des Objekts; die Eingabetaste nimmt den in der Mitte.',
    clear: 'Löschen', add: 'Notizen setzen',
    addHelp: 'Klicken Sie dorthin, wo die Notiz hingehört; die Eingabetaste nimmt die Mitte.',
    title: 'Titel', text: 'Text', remove: 'Entfernen', save: 'Als Datei sichern', image: 'Bild',
    ar: 'In Ihrem Raum ansehen' },
  fr: { notes: 'Notes', tour: 'Visite', stop: 'Arrêter la visite', close: 'Fermer', next: 'Suivant',
    before: 'Précédent', measure: 'Mesurer',
    measureHelp: "Cliquez sur des points de l'objet ; Entrée prend celui du milieu.",
    clear: 'Effacer', add: 'Ajouter des notes', addHelp: 'Cliquez où va la note ; Entrée prend le milieu.',
    title: 'Titre', text: 'Texte', remove: 'Supprimer', save: 'Enregistrer un fichier', image: 'Image',
    ar: 'Voir chez vous' },
};
/** The words for a language such as "de-AT"; English where there are none. */
export const noteWordsFor = (language = ''): NoteWords =>
  noteWords[language.toLowerCase().split('-')[0]] ?? noteWords.en;
