# SPDX-License-Identifier: LGPL-2.1-or-later
"""Style of the pages that programs write."""
PAGE_STYLE = """
:root { color-scheme: light dark; font-family: sans-serif }
body { max-width: 75rem; margin: 1.5rem auto; padding: 0 1rem }
table { border-collapse: collapse } th, td { padding: .2rem .8rem; text-align: right } th:first-child { text-align: left }
tr:nth-child(even) { background: #8882 } figure { margin: 0 }
"""
