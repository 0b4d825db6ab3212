from ._page import Page as Page, names as names, page as page, write_page as write_page
